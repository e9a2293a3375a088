"""The detailed car through a manoeuvre, as a prototype would be measured.

Exudyn integrates by the generalized-alpha method. Before each step the tyres are advanced (`tyres`)
and their forces, the torques of drive and brakes and the road under the wheels are set for it. The
tyres go with the velocities expected at its end: with those of its beginning, forces lag, and a car
that stands rocks itself up on its tyres.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..demand import Demand
from ..errors import Cancelled, SimulationDiverged, SimulationError
from ..frames import CORNERS, Corner
from ..manoeuvre import Manoeuvre
from ..run import Run
from ..simulation.output_channels import Points
from .builder import Model
from .equilibrium import settle
from .ground import Ground, patch_road
from .histories import Histories, WheelSample
from .point_mass import point_mass
from .records import DetailedCar
from .tyres import Tyres, WheelMotion, wheel_motion

Array = NDArray[np.float64]

STEP = 1e-3
SAMPLE_STEP = 5e-3
LONGEST_STEP = 2e-3
"""s: with it a_x is off by 4 % already."""

SPECTRAL_RADIUS = 0.8
"""Of the generalized-alpha method at high frequency: below 1, ringing bushings die out."""

TOLERANCE = 1e-4
"""Of Newton's residual; 1e-3 is seen in z and pitch."""

REPORT = 20
"""Steps between two reports of progress, which take 0.05 s of CPU."""

ASTRAY = 0.5
"""m: a body this far from its place in the car means that the run has diverged."""


class DetailedRunDiverged(SimulationDiverged):
    """A run that left the range where the car means anything.

    partial : the run up to there, None where not even two samples were taken
    """

    def __init__(self, time: float, body: str, partial: Run | None):
        super().__init__(
            time,
            f"body '{body}'",
            "take a shorter step, or check the car's points and stiffnesses.",
        )
        self.partial = partial


def drive(
    car: DetailedCar,
    manoeuvre: Manoeuvre,
    *,
    step: float = STEP,
    sample_step: float = SAMPLE_STEP,
    points: Points = MappingProxyType({}),
    progress: Callable[[float], object] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Run:
    """Time histories of a car in a manoeuvre of kind "road".

    points : chassis points with accelerometers, from the measured point, m
    progress : told the share that is done, now and then
    cancelled : asked as often whether to stop; then Cancelled is raised
    Raises SimulationError for what the car cannot do, DetailedRunDiverged with the part before.
    """
    every = _samples_every(step, sample_step)
    if manoeuvre.kind != "road":
        raise SimulationError(
            f"Manoeuvre '{manoeuvre.name}' is one of a rig, on which the detailed car cannot"
            ' stand; choose one of kind "road".'
        )
    demand = manoeuvre.demand(point_mass(car))
    model = Model(car)
    settle(model)
    return _Drive(model, demand, step, every, points, progress, cancelled).run(manoeuvre.name)


def _samples_every(step: float, sample_step: float) -> int:
    """Steps between samples."""
    if not 0.0 < step <= LONGEST_STEP:
        raise SimulationError(f"step is {step:g} s; give one above 0 and up to {LONGEST_STEP:g} s.")
    every = round(sample_step / step)
    if every < 1 or abs(every * step - sample_step) > 1e-9 * sample_step:
        raise SimulationError(
            f"sample_step ({sample_step:g} s) is no whole number of steps of {step:g} s; change"
            " one of them."
        )
    return every


@contextmanager
def _interrupts_kept(arrived: list[int]) -> Iterator[None]:
    """Signals that would raise in the midst of Exudyn, which answers with an error of its own, are
    kept and raised again at the end.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, frame: arrived.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in arrived:
            signal.raise_signal(number)


class _Drive:
    """One run of a model that stands at rest."""

    def __init__(
        self,
        model: Model,
        demand: Demand,
        step: float,
        every: int,
        points: Points,
        progress: Callable[[float], object] | None,
        cancelled: Callable[[], bool] | None,
    ):
        car = model.car
        assert demand.road is not None
        self._model, self._demand, self._step, self._every = model, demand, step, every
        self._told = progress or (lambda share: None)
        self._cancelled = cancelled or (lambda: False)
        self._steps = int(np.ceil(demand.duration / (every * step) - 1e-9)) * every
        self._tyres = Tyres(car.tyre)
        corners: list[Corner] = [wheel.corner for wheel in car.wheels]
        self._columns = [CORNERS.index(corner) for corner in corners]
        self._ground = Ground(patch_road(demand.road, car.tyre.patch_length), corners)
        self._origin = car.measured_point[0]
        self._design = model.design[model.wheels]
        self._offset = np.array([model.in_body(w.body, w.centre)[2] for w in car.wheels])
        self._done = 0
        self._failure: BaseException | None = None
        self._interrupts: list[int] = []
        self._lost: str | None = None
        self.histories = Histories(model, self._steps // every + 1, every * step, points)

    def run(self, name: str) -> Run:
        """Integrate and read the channels."""
        model, system = self._model, self._model.system
        self._start()
        system.SetPreStepUserFunction(self._before_step)
        with _interrupts_kept(self._interrupts):
            try:
                system.SolveDynamic(self._settings())
                if self._failure is None and self._lost is None:
                    self._sample(self._motion())
            except model.exudyn.ExudynError:
                self._lost = self._lost or self.histories.farthest_astray()[0]
        if self._failure is not None:
            raise self._failure
        if self._lost is not None:
            partial = self.histories.run(name) if self.histories.count > 1 else None
            raise DetailedRunDiverged(self._done * self._step, self._lost, partial)
        return self.histories.run(name)

    def _start(self) -> None:
        """Rest, moving along at the initial speed with rolling wheels."""
        model, data = self._model, self._model.system.systemData
        rates = np.zeros((len(model.groups), 6))
        rates[:, 0] = self._demand.initial_speed
        rates[model.wheels, 5] = self._demand.initial_speed / model.car.tyre.rolling_radius
        initial = model.exudyn.ConfigurationType.Initial
        data.SetODE2Coordinates_t(rates.ravel(), initial)

    def _settings(self) -> Any:
        settings = self._model.exudyn.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = 1e9
        settings.linearSolver.solverType = self._model.exudyn.LinearSolverType.EigenSparse
        time = settings.timeIntegration
        time.verboseMode = 0
        time.numberOfSteps, time.endTime = self._steps, self._steps * self._step
        time.adaptiveStep = False
        time.newton.useModifiedNewton = True
        time.newton.relativeTolerance = TOLERANCE
        time.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
        return settings

    def _before_step(self, system: Any, end: float) -> bool:
        """Set what acts during the step that ends at a time; False stops.

        An exception must not pass through Exudyn: it is kept and raised afterwards.
        """
        if self._interrupts:
            return False
        try:
            return self._set_forces(system, end)
        except BaseException as failure:
            self._failure = failure
            return False

    def _set_forces(self, system: Any, end: float) -> bool:
        if self._done % REPORT == 0:
            self._told(self._done / self._steps)
            if self._cancelled():
                raise Cancelled("The run of the detailed car was cancelled.")
        motion = self._motion()
        if self._done % self._every == 0 and not self._sample(motion):
            return False
        height, rate = self._road(motion, self._step)
        load = self._tyres.load(motion, height, rate)
        drive, brake = self._torques(end)
        force, torque = self._tyres.advance(self._motion(self._step), load, self._step)
        self._set_wheels(system, motion, height, rate, force, torque, drive)
        for number, most in zip(self._model.brakes, brake, strict=True):
            system.SetObjectParameter(number, "damping", most)
        self._done += 1
        return True

    def _torques(self, time: float) -> tuple[Array, Array]:
        """Drive and brake torques (4,) that are asked for up to a time, N m."""
        drive, brake = (one.at(time, "left") for one in (self._demand.drive, self._demand.brake))
        return drive[self._columns], brake[self._columns]

    def _motion(self, ahead: float = 0.0) -> WheelMotion:
        """The wheels' motion, with the velocities that accelerations make of it a time later."""
        data, wheels = self._model.system.systemData, self._model.wheels
        q = data.GetODE2Coordinates().reshape(-1, 6)[wheels] + self._design
        qd = data.GetODE2Coordinates_t().reshape(-1, 6)[wheels]
        if ahead:
            qd = qd + ahead * data.GetODE2Coordinates_tt().reshape(-1, 6)[wheels]
        return wheel_motion(q, qd, self._offset)

    def _road(self, motion: WheelMotion, ahead: float = 0.0) -> tuple[Array, Array]:
        """Height and its rate (4,) under the wheels where their speeds take them a time later."""
        speed = motion.velocity[:, 0]
        height, slope = self._ground.under(motion.centre[:, 0] + ahead * speed - self._origin)
        return height, slope * speed

    def _set_wheels(self, system, motion, height, rate, force, torque, drive) -> None:
        """Hand a step's road (4,), forces, torques (4, 3) and drive torques (4,) to Exudyn."""
        model = self._model
        torque = torque + drive[:, np.newaxis] * motion.axle
        for k in range(4):
            system.SetObjectParameter(model.tyres[k], "offset", [0.0, 0.0, height[k]])
            system.SetObjectParameter(model.tyres[k], "damping", [0.0, 0.0, rate[k]])
            system.SetLoadParameter(model.tractions[k], "loadVector", force[k])
            system.SetLoadParameter(model.torques[k], "loadVector", torque[k])
            if (reaction := model.reactions[k]) is not None:
                system.SetLoadParameter(reaction, "loadVector", -drive[k] * motion.axle[k])

    def _sample(self, motion: WheelMotion) -> bool:
        """Keep the present state, unless a body has left its place in the car: then False."""
        body, distance = self.histories.farthest_astray()
        if distance > ASTRAY:
            self._lost = body
            return False
        height, rate = self._road(motion)
        load = self._tyres.load(motion, height, rate)
        self.histories.keep(WheelSample(load, height, *self._torques(self._done * self._step)))
        return True
