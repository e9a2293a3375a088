"""Rows of other programs that simulate the same car through the same manoeuvre."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...engine.extras import how_to_install
from ...engine.simulation.simulate import FREE_STEP
from .cases import Case
from .modes import STAGES, relative_error, the_car, the_demand
from .row import Row
from .solve_ivp_peer import METHODS, cheapest
from .timing import one_core, ratio
from .workbench import Workbench

Array = NDArray[np.float64]

EXTRAS = {"mujoco": "bench", "exudyn": "detailed"}
"""The extra that brings a peer, by the name it is imported by."""


def optional(module: str, what: str, measure: Case) -> Case:
    """A peer's row, which says how to get the peer where it is missing."""

    def case(bench: Workbench) -> Row:
        if find_spec(module) is None:
            return Row(f"{what}: not installed; {how_to_install(EXTRAS[module])}")
        return measure(bench)

    return case


def stepped_by_mujoco(integrator: Literal["RK4", "Euler"], evaluations: int) -> Case:
    """MuJoCo at our step; evaluations : right-hand sides in one of its steps."""
    what = f"MuJoCo, {integrator}, same tree and step"

    @one_core()
    def measure(bench: Workbench) -> Row:
        from .mujoco_peer import MujocoCar

        car = MujocoCar(the_car(), bench.histories, FREE_STEP, integrator)
        return _stepped(bench, what, car.states, evaluations)

    return optional("mujoco", what, measure)


def stepped_by_exudyn() -> Case:
    """Exudyn's explicit Runge-Kutta method at our step."""
    what = "Exudyn, RK4, same tree and step"

    @one_core()
    def measure(bench: Workbench) -> Row:
        from .exudyn_peer import ExudynCar

        car = ExudynCar(the_car(), bench.histories, FREE_STEP)
        return _stepped(bench, what, car.states, STAGES)

    return optional("exudyn", what, measure)


def _stepped(bench: Workbench, what: str, states: Callable[[], Array], evaluations: int) -> Row:
    """A program that takes our histories, timed in turn with our single car."""
    reference = bench.histories.states
    theirs, ours = bench.pace.alternate(states, bench.our_run)
    return Row(
        what,
        theirs,
        seconds=bench.road.seconds,
        evaluations=evaluations * (len(reference) - 1),
        error=relative_error(states(), reference),
        ratio=ratio(theirs, ours),
    )


def solved_by_scipy(method: str) -> Case:
    """`solve_ivp` with the setting that is the cheapest at our error."""

    @one_core()
    def measure(bench: Workbench) -> Row:
        mode = bench.road
        [reference] = mode.converged(bench.one)
        choice = cheapest(method, bench.one[0], the_demand(), mode.time, reference, bench.our_error)
        theirs, ours = bench.pace.alternate(choice.solver.solve, bench.our_run)
        tolerances = f"rtol {choice.solver.relative:.1e}, atol {choice.solver.absolute:.1e}"
        return Row(
            f"solve_ivp, {method}, {tolerances}",
            theirs,
            seconds=mode.seconds,
            evaluations=choice.evaluations,
            error=choice.error,
            ratio=ratio(theirs, ours),
        )

    return measure


PEERS: Mapping[str, Callable[[Workbench], Row]] = {
    "mujoco-rk4": stepped_by_mujoco("RK4", STAGES),
    "mujoco-euler": stepped_by_mujoco("Euler", 1),
    "exudyn-rk4": stepped_by_exudyn(),
    **{method.lower(): solved_by_scipy(method) for method in METHODS},
}
"""Rows by name, in the order of the table."""
