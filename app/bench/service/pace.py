"""How long to measure."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Pace:
    """seconds : under load;  repetitions : of what is done once;  sessions : that are opened;
    cars : of the larger sweep.
    """

    seconds: float = 30.0
    repetitions: int = 5
    sessions: int = 200
    cars: int = 100_000


THOROUGH, QUICK = Pace(), Pace(seconds=6.0, repetitions=2, sessions=20, cars=20_000)
