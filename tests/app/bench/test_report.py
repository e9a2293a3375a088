"""The table and its JSON: every row, and figures that follow from what was measured."""

import json
import os
import re
from pathlib import Path

import pytest
from ridetune.app.bench import peers
from ridetune.app.bench.machine import describe, extensions, processor_name
from ridetune.app.bench.row import Row
from ridetune.app.bench.run import ROWS
from ridetune.app.bench.table import HEAD, Report, report_to_json, table
from ridetune.app.bench.timing import Pace, Timing, one_core, ratio
from ridetune.app.bench.workbench import Workbench
from ridetune.app.cli import main
from ridetune.engine.extras import how_to_install

README = (Path(__file__).parents[3] / "README.md").read_text()


def test_figures_of_a_row_follow_from_its_time():
    """Oracle: 8 cars with 100 evaluations of 50 operations each in 1.6 us are 2 ns each."""
    timing = Timing((1.6e-6, 1.5e-6, 9.0e-6))
    row = Row("8 cars", timing, 8, 2.0, 100, 50, error=1e-6, ratio=3.0)
    assert (timing.median, timing.fastest) == (1.6e-6, 1.5e-6)
    assert row.nanoseconds == pytest.approx(2.0)
    assert row.times_real_time == pytest.approx(16.0 / 1.6e-6)
    assert row.peak_share(100e9) == pytest.approx(50 / 2e-9 / 100e9)


def test_works_are_timed_in_turn_and_compared_turn_by_turn():
    """Oracle: a clock of our own, on which one work takes 3 and the other, ever slower, 1, 2, 4."""
    now, slower, calls = [0.0], iter([9.0, 1.0, 2.0, 4.0]), []

    def one():
        now[0] += 3.0
        calls.append("one")

    def other():
        now[0] += next(slower)
        calls.append("other")

    first, second = Pace(3, 0.0).alternate(one, other, clock=lambda: now[0])
    assert calls == ["one", "other"] * 4
    assert first.repetitions == (3.0, 3.0, 3.0)
    assert second.repetitions == (1.0, 2.0, 4.0)
    assert ratio(first, second) == 1.5


def test_one_core_is_given_back():
    """Oracle: the system's own account of the cores this process may use."""
    before = os.sched_getaffinity(0)
    with one_core():
        assert len(os.sched_getaffinity(0)) == 1
    assert os.sched_getaffinity(0) == before


def test_processor_is_told_as_linux_names_it():
    intel = "cpu family\t: 6\nmodel\t\t: 85\nmodel name\t: Xeon Gold\nflags\t\t: avx2 fma tsc\n"
    assert processor_name(intel) == "Xeon Gold (family 6, model 85)"
    assert extensions(intel) == ["avx2", "fma"]
    assert extensions("Features\t: fp asimd sve\n") == ["asimd", "sve"]
    assert processor_name("") != ""
    assert {"python", "numpy", "numba"} <= set(describe()["versions"])


def test_a_missing_peer_is_a_row_that_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    row = ROWS["mujoco-rk4"](Workbench())
    assert row.timing is None
    assert row.what.endswith(f"not installed; {how_to_install('bench')}")
    report = Report(describe(), 1e9, {}, {"mujoco-rk4": row})
    cells = table(report)[1]
    assert len(cells) == len(HEAD)
    assert (cells[0], cells[-1]) == ("mujoco-rk4", row.what)
    assert report_to_json(report)["rows"][0]["seconds"] is None


def test_readme_shows_every_row():
    (shown,) = re.findall(r"^    row  .*?what\n(.*?)\n\n", README, re.MULTILINE | re.DOTALL)
    assert [line.split()[0] for line in shown.splitlines()] == list(ROWS)


def test_command_prints_and_writes_the_rows_asked_for(tmp_path, capsys):
    """Oracle: our error is of order 4: far below the norm's 1 at 2 ms, and MuJoCo's above it."""
    path = tmp_path / "bench.json"
    names = ["start-page", "mujoco-rk4", "road-one"]
    assert main(["bench", "--quick", "--only", *names, "-o", str(path)]) == 0
    printed = capsys.readouterr()
    ordered = [name for name in ROWS if name in names]
    lines = [line.split()[0] for line in printed.out.splitlines() if line]
    assert [name for name in lines if name in ROWS] == ordered
    assert [line for line in printed.err.splitlines() if "road-one" in line]
    written = json.loads(path.read_text())
    assert [row["name"] for row in written["rows"]] == ordered
    assert all(row["seconds"] > 0.0 for row in written["rows"])
    ours, theirs = written["rows"][:2]
    assert 0.0 < ours["error"] < 1e-4
    assert ours["error"] < theirs["error"] < 1e-2
    assert theirs["times_ours"] > 0.0
    assert 0.0 < ours["peak_share"] < 1.0
