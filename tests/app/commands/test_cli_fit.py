"""What `ridetune identify` prints of a fit."""

import math
from types import SimpleNamespace

import pytest
from ridetune.app.commands.identify import print_fit


@pytest.mark.parametrize(
    ("interval", "said"),
    [
        ((10.0, 14.0), "2.0"),
        ((12.34, math.inf), "from 12.340"),
        ((-math.inf, 40.0), "up to 40.000"),
        ((-math.inf, math.inf), "unbounded"),
    ],
)
def test_of_an_open_interval_the_known_end_is_printed(capsys, interval, said):
    """In the words of the page, as exact as the value beside it."""
    one = SimpleNamespace(
        title="d_F", value=12.0, unit="m", determined="no", confidence_interval=interval
    )
    fit = SimpleNamespace(
        parameters=[one],
        sensors=[],
        fit_percent={},
        starts=1,
        outcome="Done.",
        simulations=1,
        seconds=1.0,
        verdict=SimpleNamespace(sentences=[]),
        warnings=[],
        offers=[],
    )
    print_fit(fit)  # pyright: ignore[reportArgumentType]
    row = capsys.readouterr().out.splitlines()[1]
    assert row.split() == ["d_F", "12.000", *said.split(), "m", "no"]
