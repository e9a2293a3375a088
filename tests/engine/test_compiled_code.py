"""The machine code of the kernels: packed where the processor can, never older than its sources."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features
from ridetune import engine
from ridetune.engine.jit import ARITHMETIC
from ridetune.engine.kernels.integrate import integrate_free, integrate_rims
from ridetune.engine.kernels.lanes import BATCH
from ridetune.engine.manoeuvre import reference_manoeuvres
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_states, rims_states
from ridetune.engine.simulation.rims import prepare
from ridetune.engine.simulation.simulate import simulate_posts
from ridetune.engine.simulation.stepping import prepare_free

from ..factories import paper_vehicle

ARITHMETIC_INSTRUCTION = re.compile(
    r"^\s+v(?:add|sub|mul|div|sqrt|max|min|fn?m(?:add|sub)\d+)(pd|sd)\s", re.MULTILINE
)


@pytest.mark.skipif(
    not get_host_cpu_features().get("avx2"), reason="this processor has no AVX2 to pack for"
)
@pytest.mark.parametrize("kernel", [integrate_free, integrate_rims], ids=["free", "rims"])
@pytest.mark.slow
def test_a_batch_s_arithmetic_is_packed(kernel):
    """At least 80 % of the floating-point instructions work on several cars at once; a scalar
    loop over cars would have none. What a road look-up and a histogram need is left."""
    drive_a_batch()
    [signature] = [s for s in kernel.signatures if len(s[0]) == len(BATCH)]
    fresh = numba.njit(nogil=True, **ARITHMETIC)(kernel.py_func)  # code from the cache is not shown
    fresh.compile(signature)
    found = ARITHMETIC_INSTRUCTION.findall(fresh.inspect_asm(fresh.signatures[0]))
    assert len(found) > 1000
    assert found.count("pd") >= 0.8 * len(found)


def drive_a_batch():
    """Call both kernels with more than one car, so that their signatures are known."""
    vehicle, heave = paper_vehicle(), reference_manoeuvres()["heave"]
    rows = np.stack([car_row(vehicle)] * 2)
    free_states(rows, prepare_free(heave.demand(vehicle), 0.0025, 0.1))
    run = simulate_posts(vehicle, heave).run
    rims_states(rows, prepare(run, vehicle), True)


PROBE = """
from typing import NamedTuple

from ridetune.engine.jit import compiled
from ridetune.engine.kernels.forces import damper_slope


class Damper(NamedTuple):
    jounce_damping: float
    rebound_damping: float
    per_knee: float


@compiled
def in_rebound(damper):
    return damper_slope(damper, -1.0)


print(in_rebound(Damper(1200.0, 900.0, 0.0)), sum(in_rebound.stats.cache_hits.values()))
"""


def test_an_edited_helper_counts_at_the_next_start(tmp_path):
    """Oracle: arithmetic. What is compiled calls a function of another file, whose edit doubles the
    damping; taking the edit back takes it back, from the first code still in the cache."""
    package, cache = tmp_path / "ridetune", tmp_path / "cache"
    for folder in engine.__path__:
        shutil.copytree(folder, package / "engine", ignore=shutil.ignore_patterns("__pycache__"))
    forces = package / "engine" / "kernels" / "forces.py"
    original = forces.read_text()
    line = "return slope / (1.0 +"
    assert original.count(line) == 1

    (tmp_path / "probe.py").write_text(PROBE)
    assert damping_in_rebound(tmp_path, cache) == ["900.0", "0"]
    forces.write_text(original.replace(line, "return 2.0 * slope / (1.0 +"))
    assert damping_in_rebound(tmp_path, cache) == ["1800.0", "0"]
    forces.write_text(original)
    assert damping_in_rebound(tmp_path, cache) == ["900.0", "1"]
    assert len(list(cache.iterdir())) == 2


def damping_in_rebound(root: Path, cache: Path) -> list[str]:
    """What a new process with the package under a folder finds, and how often in the cache."""
    environment = {**os.environ, "PYTHONPATH": str(root), "RIDETUNE_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", "import probe"],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()
