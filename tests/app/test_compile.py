"""Compiling is told where it happens. Oracle: numba compiles once for each type of argument."""

import numba
from ridetune.app.cli import main
from ridetune.app.compile import FIRST_CALL, compiling_told


def test_the_first_kernel_that_is_compiled_is_told_and_no_other(capsys):
    @numba.njit
    def twice(number):
        return 2 * number

    with compiling_told():
        assert capsys.readouterr().err == ""
        twice(1)
        assert capsys.readouterr() == ("", f"{FIRST_CALL}\n")
        twice(1.0)
    with compiling_told():
        twice(1)
    twice(1j)
    assert capsys.readouterr() == ("", "")


def test_a_command_tells_what_it_compiles(capsys, monkeypatch):
    """In place of the kernels, which are compiled already, a function that is not."""

    def simulated(options):
        numba.njit(lambda number: 3 * number)(1)

    monkeypatch.setattr("ridetune.app.commands.simulate.simulate", simulated)
    for _ in range(2):
        assert main(["simulate", "--vehicle", "paper", "--manoeuvre", "heave"]) == 0
        assert capsys.readouterr().err == f"{FIRST_CALL}\n"


def test_a_command_that_finds_its_kernels_compiled_is_silent(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = ["simulate", "--vehicle", "paper", "--manoeuvre", "heave", "--duration", "0.2"]
    main([*command, "-o", "run.csv"])
    capsys.readouterr()
    assert main([*command, "-o", "run.csv"]) == 0
    assert capsys.readouterr().err == ""
