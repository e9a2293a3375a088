"""How much one request, one session, one caller or the whole service may ask for.

Each limit has an environment variable: RIDETUNE_LIMIT_ followed by its name in capitals.
"""

import dataclasses
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from .errors import StartError


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What one request, one session or the whole service may ask for."""

    connections: int = 2000
    peer_connections: int = 1000
    head_seconds: float = 10.0
    stalled_seconds: float = 60.0
    upload_bytes: int = 100_000_000
    body_bytes: int = 4_000_000
    body_seconds: float = 20.0
    body_rate: int = 10_000
    reader_bytes: int = 2 << 30
    reader_seconds: int = 20
    sessions: int = 1000
    user_sessions: int = 200
    browser_sessions: int = 50
    new_sessions: int = 60
    session_measurements: int = 50
    session_bytes: int = 500_000_000
    session_jobs: int = 200
    unfinished_jobs: int = 4
    session_events: int = 40
    session_streams: int = 8
    session_simulations: int = 4
    waiting_simulations: int = 64
    session_simulated_seconds: float = 200_000.0
    user_simulated_seconds: float = 1_000_000.0
    viewers: int = 200
    session_viewers: int = 8
    tab_messages: int = 200
    tab_message_bytes: int = 256_000
    readers: int = 2
    session_readings: int = 16
    waiting_readings: int = 64
    simulated_seconds: float = 600.0
    simulated_steps: int = 400_000
    banded_steps: int = 2_000_000
    identified_samples: int = 400_000
    advised_seconds: float = 1000.0
    swept_cars: int = 100_000
    swept_steps: int = 2_000_000_000
    driven_seconds: float = 600.0
    long_driven_seconds: float = 200.0
    unwatched_seconds: float = 600.0

    @classmethod
    def from_environment(cls, environment: Mapping[str, str]) -> "Limits":
        """Those that the environment states, and the defaults of all others."""
        stated: dict[str, Any] = {
            limit.name: _positive(variable, environment[variable], type(limit.default))
            for variable, limit in LIMITS.items()
            if variable in environment
        }
        return cls(**stated)


LIMITS = {f"RIDETUNE_LIMIT_{limit.name.upper()}": limit for limit in dataclasses.fields(Limits)}
"""Each limit by its environment variable."""


def _positive(variable: str, text: str, kind: Any) -> int | float:
    """A finite number above 0 of the limit's kind."""
    with suppress(ValueError):
        if 0 < (number := kind(text)) < math.inf:
            return number
    what = "whole number" if kind is int else "number"
    raise StartError(f"{variable} is {text!r}; give a {what} above 0.")
