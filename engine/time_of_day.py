"""Times of day as loggers write them, with a date or without.

12:00:00.010   12:00:00,01   2024-03-12 12:00:00.01   2024-03-12T12:00:00Z   12.03.2024 12:00:00,01
"""

import re
from datetime import date

_TEXT = re.compile(
    r"\s*(?:(?:(\d{4})-(\d\d)-(\d\d)|(\d\d?)\.(\d\d?)\.(\d{4}))[ T])?"
    r"(\d\d?):([0-5]\d):([0-5]\d)(?:[.,](\d{1,9}))?Z?\s*",
    re.ASCII,
)
_DAY = 86_400.0


def is_time_of_day(text: str) -> bool:
    """Whether a text is a time of day."""
    return bool(_TEXT.fullmatch(text))


class SecondsFromFirst:
    """Times of day, one after the other, as seconds from the first; midnight may be passed."""

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None
        self._day, self._last = 0, 0.0

    def of(self, text: str) -> float | None:
        """The seconds of the next text; None for one that is no time of day."""
        match = _TEXT.fullmatch(text)
        if match is None:
            return None
        year, month, day, day_first, month_second, year_last, *clock, fraction = match.groups()
        hours, minutes, seconds = map(int, clock)
        within = 3600.0 * hours + 60.0 * minutes + seconds + float(f"0.{fraction or 0}")
        if year or year_last:
            try:
                stated = date(
                    *map(int, (year or year_last, month or month_second, day or day_first))
                )
            except ValueError:
                return None
            self._day = stated.toordinal()
        elif within < self._last - 0.5 * _DAY:
            self._day += 1
        self._last = within
        if self._first is None:
            self._first = self._day, within
        return _DAY * (self._day - self._first[0]) + (within - self._first[1])
