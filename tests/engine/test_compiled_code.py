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


SPRING_FORCE = """
import numpy as np
from ridetune.engine.simulation.car_rows import car_row
from ridetune.engine.simulation.integration import free_outputs
from ridetune.engine.simulation.output_channels import corner_output
from ridetune.engine.roads.road import Road
from ridetune.engine.vehicle_file import reference_vehicles

states = np.zeros((1, 16))
states[0, 4] = 0.01
row = car_row(reference_vehicles()["paper"])
outputs = free_outputs(row, states, np.zeros((1, 16)), Road.flat())
print(repr(float(corner_output(outputs, 0, "spring")[0])))
"""


def test_an_edited_helper_counts_at_the_next_start(tmp_path):
    """Oracle: arithmetic. A kernel calls a function of another file, whose edit doubles the spring
    force; taking the edit back takes it back, from the first code still in the cache."""
    package, cache = tmp_path / "ridetune", tmp_path / "cache"
    for folder in engine.__path__:
        shutil.copytree(folder, package / "engine", ignore=shutil.ignore_patterns("__pycache__"))
    forces = package / "engine" / "kernels" / "forces.py"
    original = forces.read_text()
    line = "spring = corner.preload + corner.stiffness * travel"
    assert original.count(line) == 1

    first = spring_force(tmp_path, cache)
    forces.write_text(original.replace(line, line.replace("= ", "= 2.0 * (") + ")"))
    assert np.isclose(spring_force(tmp_path, cache), 2.0 * first, rtol=1e-14)
    forces.write_text(original)
    assert spring_force(tmp_path, cache) == first
    assert len(list(cache.iterdir())) == 2


def spring_force(root: Path, cache: Path) -> float:
    """What a new process with the package under a folder finds."""
    environment = {**os.environ, "PYTHONPATH": str(root), "RIDETUNE_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", SPRING_FORCE],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)
