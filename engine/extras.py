"""How to get the packages of an extra of ridetune where they are missing."""

import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
"""The top of the checkout, where this runs from one."""


def how_to_install(extra: str) -> str:
    """What to run, as the end of a sentence."""
    if not (CHECKOUT / "pyproject.toml").is_file():
        return f'run pip install "ridetune[{extra}]" in the environment of ridetune'
    if Path(sys.prefix).resolve() != CHECKOUT / ".venv":
        return f'run pip install -e ".[{extra}]" in the folder of ridetune'
    # The environment that ./run makes has no pip; where there was no uv, it has brought one.
    uv = ".uv/bin/uv" if (CHECKOUT / ".uv/bin/uv").is_file() else "uv"
    return f'run {uv} pip install -p .venv -e ".[{extra}]" in the folder of ridetune'
