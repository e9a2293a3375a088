"""One line of the table: what was measured, and what follows from it."""

from dataclasses import dataclass

from .timing import Timing


@dataclass(frozen=True, slots=True)
class Row:
    """One measurement; what does not apply to it is None.

    what : a few words
    cars : simulated together; seconds : simulated time of each, s
    evaluations : right-hand sides of each car
    operations : floating-point operations of a right-hand side
    error : see `modes.relative_error`
    ratio : how many times longer than our single car's Manoeuvre 2, measured in turn with it
    """

    what: str
    timing: Timing | None = None
    cars: int = 1
    seconds: float | None = None
    evaluations: int | None = None
    operations: int | None = None
    error: float | None = None
    ratio: float | None = None

    @property
    def nanoseconds(self) -> float | None:
        """Time of a right-hand side of one car, ns."""
        if self.timing is None or self.evaluations is None:
            return None
        return 1e9 * self.timing.median / (self.cars * self.evaluations)

    @property
    def times_real_time(self) -> float | None:
        """Simulated time of all cars over the time it took."""
        if self.timing is None or self.seconds is None:
            return None
        return self.cars * self.seconds / self.timing.median

    def peak_share(self, peak: float) -> float | None:
        """Share of the peak, in floating-point operations a second, that right-hand sides reach."""
        if self.operations is None or self.nanoseconds is None:
            return None
        return self.operations / (1e-9 * self.nanoseconds * peak)
