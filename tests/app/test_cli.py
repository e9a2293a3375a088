"""The command line as a person meets it, whatever the command."""

import os
import signal
import subprocess
import sys
import urllib.request
from importlib.metadata import version

import pytest
from ridetune.app.cli import main
from ridetune.engine.vehicle_file import reference_vehicles, write_vehicle

from .command_line import PROGRAM, refused


def test_describing_the_commands_imports_no_engine():
    check = (
        "import sys; from ridetune.app.cli import command_line; command_line().format_help();"
        "print({'numpy', 'numba', 'scipy', 'fastapi'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("identfy run.csv", "did you mean identify?"),
        ("", "COMMAND"),
        ("simulate --vehicel paper", "did you mean --vehicle?"),
        ("simulate --vehicle= --manoeuvre 1 -o r.csv", "--vehicle is empty"),
        ("simulate --vehicle paper --rims a.csv --rims b.csv", "--rims is given twice"),
        ("simulate --vehicle paper --manoeuvre 1 -o a.csv --output b.csv", "given twice"),
        ("simulate --vehicle paper --manoeuvre 1 -oa.csv -ob.csv", "-o is given twice"),
        ("simulate --vehicle paper --rims a --model 8dof --model=7dof", "--model is given twice"),
        ("campaign --seed 0 --seed 1 -o runs", "--seed is given twice"),
        ("identify --vehicle paper --free K_F run.csv", "put the recordings first"),
        ("identify --vehicle paper --free K_F -- run.csv", "run.csv: the file cannot be read"),
        ("simulate --vehicle paper", "--manoeuvre --rims --posts"),
        ("simulate --vehicle paper --manoeuvre 1", "-o"),
        ("simulate --vehicle paper --manoeuvre 1 --model 9dof -o r.csv", "'9dof'"),
        ("simulate --vehicle papper --manoeuvre 1 -o r.csv", "did you mean paper?"),
        ("simulate --vehicle paper --manoeuvre braek -o r.csv", "did you mean brake?"),
        ("simulate --vehicle paper --manoeuvre 1 --road none.csv -o r.csv", "none.csv"),
        ("simulate --vehicle paper --manoeuvre heave --road r.csv -o r.csv", "leave out --road"),
        ("simulate --vehicle paper --manoeuvre 1 --seed -1 -o r.csv", "'-1'"),
        ("simulate --vehicle paper --manoeuvre bump --seed 3 -o r.csv", "leave out --seed"),
        ("simulate --vehicle paper --manoeuvre 1 --road r --seed 3 -o r.csv", "leave out --seed"),
        ("simulate --vehicle paper --rims run.csv --seed 3", "--seed belongs to --manoeuvre"),
        ("simulate --vehicle paper --rims run.csv --road r.csv", "--road belongs to --manoeuvre"),
        ("simulate --vehicle paper --manoeuvre 1 --traction paper -o r.csv", "--rims"),
        ("simulate --vehicle paper --manoeuvre 1 --rim-cutoff 20 -o r.csv", "--rim-cutoff belongs"),
        ("simulate --vehicle paper --posts r.csv --braking 1:2 -o r.csv", "--braking belongs"),
        ("simulate --vehicle paper --rims run.csv --lift-off", "--lift-off"),
        ("simulate --vehicle paper --rims run.csv", "run.csv"),
        ("simulate --vehicle paper --posts run.csv -o r.csv", "run.csv"),
        ("identify run.csv --vehicle paper", "run.csv"),
        ("identify run.csv --vehicle paper --noise n.toml", "n.toml"),
        ("identify run.csv --vehicle paper --colour", "--colour"),
        ("campaign --plant detailed --vehicle v.json -o runs", "leave out --vehicle"),
        ("campaign --noise n.toml -o runs", "n.toml"),
        ("bench --only raod-one", "--only raod-one: there is no row of that name; did you mean"),
        ("bench --only everything", "there are road-one, "),
        ("bench --only", "--only"),
        ("bench --quick -o none/bench.json", "there is no folder none"),
    ],
)
def test_bad_command_is_refused_in_one_line_that_names_the_place(folder, capsys, arguments, told):
    assert told in refused(capsys, *arguments.split())
    assert not list(folder.iterdir())


def test_what_a_shell_makes_of_an_unset_variable_is_refused(folder, capsys):
    assert "an argument is empty" in refused(capsys, "simulate", "--vehicle", "paper", "--rims", "")
    assert "an argument is empty" in refused(capsys, "campaign", "-o", "")
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("command", "place"),
    [
        ("identify run.csv --vehicle car.json", "run.csv"),
        ("identify run.csv --vehicle car.json", "run.toml"),
        ("identify run.csv --vehicle car.json", "car.json"),
        ("identify run.csv --vehicle car.json --noise noise.toml", "noise.toml"),
        ("simulate --vehicle car.json --rims run.csv", "run.csv"),
        ("simulate --vehicle car.json --posts run.csv", "run.csv"),
        ("simulate --vehicle car.json --manoeuvre bump", "car.json"),
        ("simulate --vehicle car.json --manoeuvre short.json", "short.json"),
        ("simulate --vehicle car.json --manoeuvre 1 --road road.csv", "road.csv"),
    ],
)
def test_no_input_is_written_over(folder, capsys, command, place):
    """Whatever way leads to it; refused before anything is read."""
    write_vehicle(reference_vehicles()["paper"], "car.json")
    for name in ("run.csv", "run.toml", "noise.toml", "short.json", "road.csv"):
        (folder / name).write_text(f"an engineer's {name}")
    kept = (folder / place).read_bytes()
    (folder / "link").symlink_to(place)
    for way in (place, f"./{place}", "link"):
        message = refused(capsys, *command.split(), "-o", way)
        assert f"ridetune: {way}: this is {place} itself" in message
    assert (folder / place).read_bytes() == kept


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"ridetune {version('ridetune')}\n"


def test_closed_pipe_ends_quietly(folder):
    command = [sys.executable, "-c", PROGRAM, "campaign", "-o", "runs"]
    shell = ["sh", "-c", '{ "$@"; echo $? >status; } 2>errors | true', "sh", *command]
    subprocess.run(shell, check=True)
    assert (folder / "errors").read_text() == ""
    assert (folder / "status").read_text() == "141\n"


def test_interrupt_ends_quietly(folder):
    """The vehicle is a pipe that nobody writes to, so the command waits until interrupted.

    Tests that run in the background of a shell ignore interrupts, and so would the command.
    """
    os.mkfifo("car.json")
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    program = [sys.executable, "-c", listening + PROGRAM]
    command = [*program, "identify", "run.csv", "--vehicle", "car.json"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as waiting:
        # Opens when the command does. Closed again, since a signal just before the command's read
        # would find it waiting for ever.
        with open("car.json", "w"):
            waiting.send_signal(signal.SIGINT)
        assert waiting.wait(timeout=60) == 130
        assert waiting.stderr.read() == ""


def test_serve_answers_until_interrupted(folder):
    command = [sys.executable, "-u", "-c", PROGRAM, "serve", "--port", "0", "--data", "data"]
    environment = {name: value for name, value in os.environ.items() if "RIDETUNE" not in name}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as service:
        try:
            address, _, _ = service.stdout.readline().removeprefix("Open ").partition("?")
            with urllib.request.urlopen(f"{address}healthz", timeout=30) as reply:
                assert reply.status == 200
        finally:
            service.send_signal(signal.SIGINT)
        assert service.wait(timeout=60) == 0
