"""How long the searches still take. Oracle: searches whose lengths are told by hand."""

from types import SimpleNamespace
from typing import Any

import pytest
from ridetune.app.commands.identify import progress_line
from ridetune.app.work.time_left import SearchClock
from ridetune.engine.identification.fit import Progress, Stage


def at(stage: Stage, search: int = 0, searches: int = 8) -> Progress:
    return Progress(12, 300, 1234.5, {}, {}, stage, search, searches)


@pytest.fixture
def hand():
    return SimpleNamespace(now=0.0)


def told(hand, clock: SearchClock, *steps: tuple[float, int]) -> list[Any]:
    """What is left at some times, each with the search that is under way."""
    left = []
    for now, search in steps:
        hand.now = now
        left.append(clock.left(at(Stage.SEARCHING, search)))
    return left


def test_the_time_left_is_that_of_the_searches_from_other_starts_so_far(hand):
    clock = SearchClock(noise_follows=False, now=lambda: hand.now)
    assert clock.left(at(Stage.SCREENING)) is None
    # The told start takes 10 s and tells nothing of the others, which take 2 s and 4 s.
    assert told(hand, clock, (0.0, 1), (9.0, 1), (10.0, 2), (11.0, 2)) == [None] * 4
    assert told(hand, clock, (12.0, 3), (13.0, 3)) == [6 * 2.0, 5 * 2.0 + 1.0]
    assert told(hand, clock, (16.0, 4), (18.0, 4), (34.0, 8)) == [15.0, 13.0, 4.0]
    # The last one has outlasted the others, and nobody knows by how much.
    assert told(hand, clock, (38.1, 8)) == [None]
    assert clock.left(at(Stage.REWEIGHING, 1)) is None


def test_nothing_is_promised_where_noise_is_found_afterwards(hand):
    clock = SearchClock(noise_follows=True, now=lambda: hand.now)
    assert told(hand, clock, (0.0, 1), (10.0, 2), (12.0, 3), (14.0, 4)) == [None] * 4


@pytest.mark.parametrize(
    ("now", "left", "said"),
    [
        (at(Stage.SCREENING), None, "screening 64 starts"),
        (at(Stage.SEARCHING, 1), None, "search 1 of 8"),
        (at(Stage.SEARCHING, 3), 75.2, "search 3 of 8, about 0:01:15 left"),
        (at(Stage.REWEIGHING, 2, 3), None, "with the noise found, search 2 of 3"),
    ],
)
def test_the_progress_line_tells_stage_search_and_time(now, left, said):
    assert progress_line(now, 64, left) == f"300 simulations, cost 1234.5, {said}"
    alone = at(Stage.SEARCHING, 1, 1)
    assert progress_line(alone, 1, None) == "300 simulations, cost 1234.5"
