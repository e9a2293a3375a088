"""How a request lets the car be driven: told before anything is loaded for it."""

from typing import Literal

from ..errors import InvalidRequest
from ..schemas import ExcitationForm
from ..storage.measurement import Measurement
from ..storage.store import Store

Mode = Literal["manoeuvre", "rims", "posts"]
MODES: tuple[Mode, ...] = ("manoeuvre", "rims", "posts")

RECORDED = "the recording has its own; leave it out"
MEANS_NOTHING: dict[Mode, dict[str, str]] = {
    "manoeuvre": {},
    "rims": {
        "road": "the recording has its road in it; leave it out",
        "duration": RECORDED,
        "lift_off": "tyres play no part; leave it out",
        "step": "give it as rims.settings.step",
        "sample_step": "the result has the recording's own times; leave it out",
    },
    "posts": {"road": "a rig has none; leave it out", "duration": RECORDED},
}
"""By mode, what of a request would change nothing, and the remedy."""


def mode_of(request: ExcitationForm) -> Mode:
    """What a request lets the car go through; InvalidRequest for what means nothing with it."""
    asked: list[Mode] = [name for name in MODES if getattr(request, name) is not None]
    if len(asked) > 1:
        raise InvalidRequest(f"The request has {' and '.join(asked)}; leave one of them.")
    mode = asked[0] if asked else "manoeuvre"
    for name, remedy in MEANS_NOTHING[mode].items():
        if getattr(request, name) not in (None, False):
            raise InvalidRequest(
                f"The field {name} means nothing with {mode}: {remedy}.", field=name
            )
    return mode


def recording_of(request: ExcitationForm, session: str, store: Store) -> Measurement | None:
    """The measurement that moves the car, if one does."""
    asked = request.rims or request.posts
    return None if asked is None else store.measurements.get(session, asked.measurement)
