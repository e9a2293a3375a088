"""Signs that a file states in words: "nose up", "down positive", "Verzoegerung"."""

import re
from collections.abc import Mapping

AGAINST: Mapping[str, str] = {
    "chassis.pitch": r"nose[ _-]?up|bug[ _-]?hoch",
    "chassis.pitch_rate": r"nose[ _-]?up|bug[ _-]?hoch",
    "chassis.roll": r"right[ _-]?(side[ _-]?)?up|left[ _-]?(side[ _-]?)?down",
    "chassis.roll_rate": r"right[ _-]?(side[ _-]?)?up|left[ _-]?(side[ _-]?)?down",
    "chassis.a_x": r"deceleration|\bdecel|verzoegerung|verzögerung|rearward|backward",
    "z": r"\bz[ _-]?down|down(wards?)?[ _-]?(is[ _-]?)?(positive|pos\b|\+)|positive[ _-]?down",
    "travel": r"(rebound|extension|droop|ausfedern)[ _-]?(is[ _-]?)?(positive|pos\b|\+)"
    r"|positive[ _-]?(in[ _-]?)?(rebound|extension|droop)",
}
"""By channel or its last part, what says that it is turned over."""


def stated_sign(channel: str, *texts: str) -> tuple[int, str]:
    """The sign of a channel, and the words that turn it over; 1 and "" where nothing is said."""
    pattern = AGAINST.get(channel) or AGAINST.get(channel.rsplit(".", 1)[-1])
    for text in texts if pattern else ():
        if found := re.search(pattern or "", text, re.IGNORECASE):
            return -1, found[0]
    return 1, ""
