"""The documentation tells the truth: its example runs, its tables are the engine's."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ridetune.engine.channels import CHANNEL_KINDS
from ridetune.engine.mapping.mapping import mapping_from_json
from ridetune.engine.parameters import ALL_PARAMETERS, PARAMETERS
from ridetune.engine.vehicle_file import vehicle_from_text

from tests.app.live import LiveService

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONVENTIONS = (ROOT / "docs" / "conventions.md").read_text()
PAGES = [ROOT / "README.md", ROOT / "sample_runs" / "README.md", *(ROOT / "docs").glob("*.md")]


def test_readme_example_identifies_the_sample_car():
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    done = subprocess.run([sys.executable, "-c", example], cwd=ROOT, capture_output=True, text=True)
    assert done.stderr == ""
    assert "The fit converged" in done.stdout
    assert all(parameter.name in done.stdout for parameter in PARAMETERS)
    assert "chassis.z" in done.stdout.splitlines()[-1]


def test_readme_requests_are_taken_as_they_stand_as_often_as_they_are_sent(tmp_path):
    """But for the port and where things are. Oracle: the ends that jobs tell."""
    beginning = r"^## REST\n\n[^\n]*\n\n"
    [block] = re.findall(beginning + r"((?:    [^\n]*\n|\n(?=    ))+)", README, re.MULTILINE)
    data = tmp_path / "data"
    here = tmp_path / "here"
    (here / ".venv").mkdir(parents=True)
    (here / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
    (here / "sample_runs").symlink_to(ROOT / "sample_runs")
    with LiveService(data) as service:
        script = block.replace("http://127.0.0.1:8000", service.ready().address)
        for _ in range(2):
            done = subprocess.run(
                ["bash", "-c", script],
                cwd=here,
                env={**os.environ, "RIDETUNE_DATA": str(data)},
                capture_output=True,
                text=True,
            )
            assert done.returncode == 0
            assert len(re.findall('"state": ?"done"', done.stdout)) == 4, done.stdout
            assert "about:blank" not in done.stdout, "nothing is refused"
            assert "not found" not in done.stderr
            for made in ("run.csv", "cars.parquet", "campaign.zip"):
                assert (here / made).stat().st_size > 1000
                (here / made).unlink()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        assert target.startswith("http://127.0.0.1") or (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_row_is_in_a_table(page):
    """Oracle: GitHub Flavored Markdown, in which a table is a head, a line of dashes and rows."""
    for block in re.findall(r"(?:^\|.*\n?)+", page.read_text(), re.MULTILINE):
        assert re.match(r".*\n\|( *:?-+:? *\|)+$", block, re.MULTILINE), block


def test_every_channel_is_in_the_table():
    rows = re.findall(r"^\| `(\S+)` \| (.+?) \|.+\|.+\|$", CONVENTIONS, re.MULTILINE)
    assert rows == [(info.name, info.unit) for info in CHANNEL_KINDS]


def test_every_parameter_is_in_the_table():
    rows = re.findall(r"^\| (\w+) \| `(\S+)` \| (.+?) \|$", CONVENTIONS, re.MULTILINE)
    assert rows == [(one.symbol, one.name, one.unit) for one in ALL_PARAMETERS]


def test_mapping_example_is_one():
    files = (ROOT / "docs" / "files.md").read_text()
    (example,) = re.findall(r'^    (\{"columns": .*?"step": null\})$', files, re.M | re.S)
    mapping = mapping_from_json(json.loads(example))
    assert [one.channel for one in mapping.columns] == ["time", "chassis.pitch"]


def test_vehicle_example_is_one():
    """With the front axle standing for the rear, as the text says."""
    (example,) = re.findall(
        r'^    (\{"name": "\.\.\.",\n     "chassis".*?\}\})$', CONVENTIONS, re.M | re.S
    )
    front = re.search(r'"front": (\{.*?\}),\n     "rear"', example, re.DOTALL)[1]
    rear = front.replace('"driven": false', '"driven": true')
    vehicle = vehicle_from_text(example.replace('"rear": {...}', f'"rear": {rear}').encode())
    assert vehicle.brakes.front_share == 0.65
