"""Which of the detailed car's physics the concept model misses: without each in turn.

    .venv/bin/python docs/studies/detailed_without.py       # 25 min of CPU

Drives a changed car through Table 2's manoeuvres, fits to the first and holds out the second, with
ideal sensors. Prints the table of docs/detailed-car.md.
"""

from collections.abc import Callable
from dataclasses import replace

from ridetune.engine.campaign import Campaign, chosen, roughened
from ridetune.engine.channels import OUTPUT_CHANNELS
from ridetune.engine.detailed.car_file import reference_car
from ridetune.engine.detailed.plant import DetailedPlant
from ridetune.engine.detailed.records import BushingLaw, DetailedCar, Strut
from ridetune.engine.identification.identify import Problem, identify
from ridetune.engine.parameters import ALL_NAMES, PARAMETER_NAMES
from ridetune.engine.run import Run
from ridetune.engine.sensors import SensorSet
from ridetune.engine.simulation.simulate import simulate_rims

FAR = 0.9
"""m, gap of a stop that is never reached."""
HARDLY_BENT = 50.0
"""Factor on the scales of bushings after which they are as good as linear."""
MOUNTS = ("engine", "gearbox", "exhaust_flex", "hanger", "radiator")
SUSPENSION = (
    *("front_subframe", "lca_front", "lca_rear", "top_mount", "rack", "rear_subframe"),
    *("link", "link_oblique", "link_outer", "damper_low", "damper_top"),
)


def struts(change: Callable[[Strut], Strut]) -> DetailedCar:
    """The car with both axles' struts changed."""
    car = reference_car()
    return replace(car, front=change(car.front), rear=change(car.rear))


def bushings(change: Callable[[BushingLaw], BushingLaw]) -> DetailedCar:
    """The car with its bushing laws changed."""
    car = reference_car()
    return replace(car, bushing_laws=tuple(map(change, car.bushing_laws)))


def linear_damper(strut: Strut) -> Strut:
    """The mean of bump and rebound at every speed."""
    mean = (strut.damper.bump + strut.damper.rebound) / 2.0
    return replace(strut, damper=replace(strut.damper, bump=mean, rebound=mean, speed=99.0))


def no_digression(strut: Strut) -> Strut:
    """Bump and rebound, each at every speed."""
    return replace(strut, damper=replace(strut.damper, speed=99.0))


def no_stops(strut: Strut) -> Strut:
    """Stops that are never reached."""
    bump, rebound = (replace(stop, gap=FAR) for stop in (strut.bump_stop, strut.rebound_stop))
    return replace(strut, bump_stop=bump, rebound_stop=rebound)


def linear(law: BushingLaw) -> BushingLaw:
    """Rubber that does not harden."""
    return replace(law, scale=tuple(min(99.0, HARDLY_BENT * scale) for scale in law.scale))


def stiffer(names: tuple[str, ...], times: float) -> Callable[[BushingLaw], BushingLaw]:
    """Linear bushings of some laws, their translations that many times as stiff."""

    def change(law: BushingLaw) -> BushingLaw:
        if law.name not in names:
            return law
        moves = tuple(times * k if axis < 3 else k for axis, k in enumerate(law.stiffness))
        return replace(linear(law), stiffness=moves, time_constant=law.time_constant / times**0.5)

    return change


CARS = {
    "as it is": reference_car(),
    "dampers linear": struts(linear_damper),
    "dampers without digression": struts(no_digression),
    "no stops": struts(no_stops),
    "bushings linear": bushings(linear),
    "suspension's bushings 10 times as stiff": bushings(stiffer(SUSPENSION, 10.0)),
    "mounts of engine, gearbox, exhaust, radiator 20 times as stiff": bushings(
        stiffer(MOUNTS, 20.0)
    ),
}


def driven(plant: DetailedPlant) -> list[Run]:
    """Both manoeuvres of Table 2 on the roads of the sample runs."""
    manoeuvres = roughened(chosen(["1", "2"]), 0.5, (0.03, 2.83))
    campaign = Campaign.plan(plant, SensorSet(), manoeuvres)
    runs = []
    for name in campaign.manoeuvres:
        recording = campaign.record(name, lambda seconds: None, lambda: False)
        assert recording.run is not None, recording.failure
        runs.append(recording.run)
    return runs


def main() -> None:
    """Print a line for each car."""
    print("| car | linear dampers: z, pitch, roll | two-slope dampers: z, pitch, roll |")
    print("|---|---|---|")
    for title, car in CARS.items():
        plant = DetailedPlant.of(car)
        seen, unseen = driven(plant)
        told = []
        for names in (PARAMETER_NAMES, ALL_NAMES):
            fit = identify(Problem.build(plant.vehicle, [seen], names))
            percent = simulate_rims(fit.vehicle, unseen).fit_percent
            told.append(", ".join(f"{percent[name]:.1f}" for name in OUTPUT_CHANNELS))
        print(f"| {title} | {' | '.join(told)} |", flush=True)


if __name__ == "__main__":
    main()
