"""What drives a car, as requests for simulations and for sweeps name it.

Imported with the first of them, because it brings numba and scipy.
"""

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches

from ...engine.manoeuvre import Manoeuvre, manoeuvre_from_json, reference_manoeuvres
from ...engine.roads.road_specs import road_spec_from_json
from ...engine.run import Run
from ...engine.simulation.excitation import Excitation, FreeExcitation, RimsExcitation
from ...engine.simulation.recorded_motion import RecordedMotion, recorded_motion
from ...engine.simulation.simulate import SAMPLE_STEP, default_step
from ...engine.vehicle import Vehicle
from ..errors import InvalidRequest, NotFound
from ..recordings.lent import LentRecordings
from ..recordings.runs import with_braking
from ..schemas import ExcitationForm
from ..storage.measurement import Measurement

DEFAULT_MANOEUVRE = "2"


def manoeuvre_of(request: ExcitationForm) -> Manoeuvre:
    """The manoeuvre that is asked for, for as long and on the road that are."""
    asked = DEFAULT_MANOEUVRE if request.manoeuvre is None else request.manoeuvre
    manoeuvre = known_manoeuvre(asked) if isinstance(asked, str) else manoeuvre_from_json(asked)
    if request.duration is not None:
        manoeuvre = manoeuvre.lasting(request.duration)
    if request.road is None:
        return manoeuvre
    if manoeuvre.kind != "road":
        raise InvalidRequest(
            "A rig test has no road; leave out road or choose another manoeuvre.", field="road"
        )
    return replace(manoeuvre, road=road_spec_from_json(request.road))


def known_manoeuvre(key: str) -> Manoeuvre:
    """The manoeuvre that comes along under a key; NotFound names the nearest, or all."""
    known = reference_manoeuvres()
    if key in known:
        return known[key]
    near = get_close_matches(key, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}."
    raise NotFound(f"There is no manoeuvre by that key; {hint}")


def recording_in(
    request: ExcitationForm, kept: Measurement, recordings: LentRecordings
) -> Run | RecordedMotion:
    """The recording of a request from memory: the motion of the rims, or the run with the posts."""
    if request.rims is None:
        return recordings.run(kept)
    return recordings.motion(kept, request.rims.settings.settings(), request.rims.braking)


def excitation_of(request: ExcitationForm, recording: Run | RecordedMotion | None) -> Excitation:
    """What the engine lets the car go through.

    recording : of a request that has one
    """
    if request.rims is not None and recording is not None:
        if isinstance(recording, Run):
            run = with_braking(recording, request.rims.braking)
            recording = recorded_motion(run, request.rims.settings.settings())
        return RimsExcitation(recording, request.rims.traction)
    assert not isinstance(recording, RecordedMotion)
    motion = manoeuvre_of(request) if recording is None else recording
    return FreeExcitation(motion, None, request.lift_off, request.step, _sample_step(request))


def extent(
    request: ExcitationForm, kept: Measurement | None, cars: Sequence[Vehicle]
) -> tuple[float, float]:
    """How long each of some cars is simulated, s, and in how many steps or samples, whichever are
    more.
    """
    duration = manoeuvre_of(request).duration if kept is None else kept.summary["duration"]
    if request.rims is None or kept is None:
        step = default_step(*cars) if request.step is None else request.step
        return duration, duration / min(step, _sample_step(request))
    return duration, max(kept.summary["samples"], duration / request.rims.settings.step)


def _sample_step(request: ExcitationForm) -> float:
    """The sample step with what holds untold, s."""
    return SAMPLE_STEP if request.sample_step is None else request.sample_step
