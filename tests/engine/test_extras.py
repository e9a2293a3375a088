"""What is told to install a missing package. Oracle: each way of having ridetune."""

import sys

import pytest
from ridetune.engine import extras


@pytest.mark.parametrize(
    ("environment", "own", "command"),
    [
        (".venv", False, 'uv pip install -p .venv -e ".[detailed]"'),
        (".venv", True, '.uv/bin/uv pip install -p .venv -e ".[detailed]"'),
        ("elsewhere", True, 'pip install -e ".[detailed]"'),
    ],
)
def test_a_checkout_is_told_what_works_in_its_environment(
    tmp_path, monkeypatch, environment, own, command
):
    (tmp_path / "pyproject.toml").touch()
    if own:
        (tmp_path / ".uv" / "bin").mkdir(parents=True)
        (tmp_path / ".uv" / "bin" / "uv").touch()
    monkeypatch.setattr(extras, "CHECKOUT", tmp_path)
    monkeypatch.setattr(sys, "prefix", str(tmp_path / environment))
    assert extras.how_to_install("detailed") == f"run {command} in the folder of ridetune"


def test_a_package_that_is_installed_is_told_its_extra(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "CHECKOUT", tmp_path)
    told = extras.how_to_install("formats")
    assert told == 'run pip install "ridetune[formats]" in the environment of ridetune'
