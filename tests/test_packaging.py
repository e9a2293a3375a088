"""What is installed: the wheel holds everything and nothing else, the locks pin everything."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]
LOCKS = [ROOT / "requirements.lock", ROOT / "tests" / "requirements.lock"]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
MAPPED = {"engine", "app", "static", "sample_runs"}


def normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned(lock: Path) -> set[tuple[str, str]]:
    """(name, version) of every package a lock pins."""
    pairs = re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", lock.read_text(), re.MULTILINE)
    return {(normalized(name), version) for name, version in pairs}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A copy of all that goes into the wheel, so that a build leaves nothing in the checkout."""
    copy = tmp_path_factory.mktemp("checkout")
    for folder in MAPPED:
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    return copy


@pytest.fixture(scope="module")
def source_names(checkout) -> set[str]:
    """What the wheel should hold of the mapped folders."""
    files = (path for folder in MAPPED for path in (checkout / folder).rglob("*"))
    return {f"ridetune/{path.relative_to(checkout).as_posix()}" for path in files if path.is_file()}


@pytest.fixture(scope="module")
def wheel_names(checkout, source_names, tmp_path_factory) -> set[str]:
    out = tmp_path_factory.mktemp("wheel")
    build = f"from setuptools import build_meta; build_meta.build_wheel({str(out)!r})"
    done = subprocess.run(
        [sys.executable, "-c", build], cwd=checkout, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = out.glob("*.whl")
    return set(ZipFile(wheel).namelist())


def test_wheel_holds_exactly_the_sources_the_page_and_the_samples(wheel_names, source_names):
    assert {name for name in wheel_names if name.startswith("ridetune/")} == source_names


def test_wheel_brings_no_top_level_package_but_its_own(wheel_names):
    tops = {name.split("/")[0] for name in wheel_names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"ridetune"}


def test_locks_name_no_address():
    for lock in LOCKS:
        assert not re.search(r"://|index-url|find-links", lock.read_text()), lock


def test_every_pin_has_a_hash():
    for lock in LOCKS:
        hashed = re.findall(r"^\S+==.* \\\n    --hash=sha256:", lock.read_text(), re.MULTILINE)
        assert len(hashed) == len(pinned(lock))


def test_what_the_tests_run_on_is_what_a_start_installs():
    runtime, testing = map(pinned, LOCKS)
    assert runtime <= testing


def test_every_dependency_is_pinned():
    runtime, testing = ({name for name, _ in pinned(lock)} for lock in LOCKS)
    groups = PYPROJECT["dependency-groups"]

    def names(requirements: list[str]) -> set[str]:
        return {normalized(re.split(r"[\[<>=!~; ]", text)[0]) for text in requirements}

    extras = PYPROJECT["project"]["optional-dependencies"]["sweep"]
    assert names(PYPROJECT["project"]["dependencies"] + extras + groups["build"]) <= runtime
    assert names(groups["test"]) <= testing
