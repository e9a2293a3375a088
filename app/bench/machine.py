"""What the figures were measured on."""

import platform
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ...engine.simulation.integration import cores

EXTENSIONS = ("sse4_2", "avx", "avx2", "fma", "avx512f", "neon", "asimd", "sve")
"""Vector instructions that matter, as Linux calls them."""

PACKAGES = ("ridetune", "numpy", "scipy", "numba", "mujoco", "exudyn")


def describe() -> dict[str, Any]:
    """Processor, its vector extensions, cores this process may use, versions by package."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        text = ""
    return {
        "processor": processor_name(text),
        "extensions": extensions(text),
        "cores": cores(),
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {"python": platform.python_version(), **_versions()},
    }


def processor_name(cpuinfo: str) -> str:
    """The processor's name in /proc/cpuinfo with its family and model, which a guest may hide."""
    fields = dict(re.findall(r"^([\w ]+?)\s*: (.*)$", cpuinfo, re.MULTILINE))
    name = fields.get("model name", "").strip() or platform.processor() or platform.machine()
    numbers = [f"{key.removeprefix('cpu ')} {fields[key]}" for key in ("cpu family", "model")
               if key in fields]  # fmt: skip
    return f"{name} ({', '.join(numbers)})" if numbers else name


def extensions(cpuinfo: str) -> list[str]:
    """Those of EXTENSIONS that the processor says it has."""
    found = re.search(r"^(?:flags|Features)\s*: (.*)$", cpuinfo, re.MULTILINE)
    flags = found[1].split() if found else []
    return [name for name in EXTENSIONS if name in flags]


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
