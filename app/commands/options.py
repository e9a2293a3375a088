"""What each command takes, as its help tells. Options of one meaning are described once."""

import argparse
from pathlib import Path
from typing import Any, get_args

from ...engine.identification.search_settings import LossName
from ..work.plants import PLANTS
from .parser import Parser

LARGEST_SEED = 2**53

SEVERAL: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
"""An option with a list of values, which may be given again with more of them."""


def serve(command: Parser) -> None:
    command.add_argument("--host", help="address to listen on, 127.0.0.1 unless told")
    command.add_argument("--port", type=int, help="port to listen on, 8000 unless told")
    _add_data(command)
    command.add_argument(
        "--no-login",
        dest="login",
        action="store_const",
        const=False,
        help="let everybody on this machine in, without a link",
    )


def link(command: Parser) -> None:
    _add_data(command)


def browsers(command: Parser) -> None:
    _add_list_and_remove(command, "show which browsers are let in", "end browsers")


def sessions(command: Parser) -> None:
    _add_list_and_remove(
        command,
        "show whose each session is, and what it holds",
        "delete sessions with all they hold",
    )


def keys(command: Parser) -> None:
    actions = command.add_subparsers(metavar="add|list|remove", dest="action", required=True)
    command.commands = actions.choices
    add = actions.add_parser("add", help="make a key for a program; it is shown once")
    shown = actions.add_parser("list", help="show which keys there are")
    remove = actions.add_parser("remove", help="end a key")
    for action in (add, remove):
        action.add_argument("name", metavar="NAME", help="what the key is called")
    for action in (add, shown, remove):
        _add_data(action)


def backup(command: Parser) -> None:
    command.add_argument("--data", metavar="DIR", type=Path, help="where sessions are kept")
    command.add_argument("-o", "--output", metavar="FILE", required=True, help="the backup as ZIP")


def restore(command: Parser) -> None:
    command.add_argument("backup", metavar="FILE", type=Path, help="what ridetune backup wrote")
    command.add_argument("--data", metavar="DIR", type=Path, help="empty place for the sessions")


def simulate(command: Parser) -> None:
    _add_excitation(command)
    command.add_argument("--model", choices=("8dof", "7dof"), default="8dof")
    command.add_argument(
        "--seed", metavar="N", type=_seed, dest="road_seed", help="another random road"
    )
    command.add_argument(
        "--bands",
        choices=("linear", "sampled"),
        help="95 %% bands by the errors of the fit that --vehicle is",
    )
    command.add_argument("-o", "--output", metavar="FILE", help="the run as CSV")


def channels(command: Parser) -> None:
    command.add_argument("recording", metavar="FILE", help="recording of any kind and any names")
    _add_mapping(command)
    command.add_argument(
        "--flip", metavar="CHANNEL", **SEVERAL, help="channels whose signs are turned over"
    )
    command.add_argument("-o", "--output", metavar="FILE", help="the mapping as JSON")


def sweep(command: Parser) -> None:
    _add_excitation(command)
    command.add_argument(
        "--levels",
        metavar="NAME=LOW:HIGH:COUNT",
        **SEVERAL,
        help="every combination of levels, SI units; or NAME=V1,V2,...",
    )
    command.add_argument(
        "--range", metavar="NAME=LOW:HIGH", **SEVERAL, help="cars drawn from a box, SI units"
    )
    command.add_argument("--cars", metavar="N", help="how many are drawn")
    command.add_argument(
        "--design", choices=("sobol", "latin-hypercube"), help="how; sobol unless told"
    )
    command.add_argument("--seed", metavar="N", type=_seed, help="other cars")
    command.add_argument("--threads", metavar="N", type=int, help="one a core unless told")
    command.add_argument(
        "--histories",
        metavar=("DIR", "N"),
        nargs="+",
        help="also the histories of these cars, as CSV into a folder",
    )
    command.add_argument("--force", action="store_true", help="write over histories")
    command.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        required=True,
        help="the rows; .parquet, .arrow, .feather or .csv",
    )
    command.set_defaults(road_seed=None)


def condition(command: Parser) -> None:
    command.add_argument("run_file", metavar="RUN", help="recording")
    _add_mapping(command)
    command.add_argument("--vehicle", metavar="FILE", help="vehicle or fit file, or a known car")
    how = command.add_mutually_exclusive_group()
    how.add_argument("--steps", metavar="FILE", help="steps, JSON; those suggested unless told")
    how.add_argument(
        "--suggest", action="store_true", help="print the suggested steps as JSON, do nothing"
    )
    command.add_argument(
        "-o", "--output", metavar="FILE", help="the recording as CSV, its record beside it as TOML"
    )


def identify(command: Parser) -> None:
    _add_identification(command)
    command.add_argument(
        "--profile",
        metavar="NAME",
        nargs="+",
        action="extend",
        help="intervals by profile likelihood, too",
    )
    command.add_argument("-o", "--output", metavar="FILE", help="the fit as JSON")


def validate(command: Parser) -> None:
    _add_identification(command)
    command.add_argument(
        "--hold-out", metavar="RUN", **SEVERAL, help="recordings to predict, not fitted"
    )
    command.add_argument(
        "--manoeuvre",
        metavar="RUN=NAME",
        **SEVERAL,
        help="what was driven: a known one or a file; untold, RUN's own NAME.manoeuvre.json",
    )
    command.add_argument(
        "--geometry", metavar="FILE", help="pivots by geometry, JSON, shown beside the fit's"
    )
    command.add_argument("--json", metavar="FILE", help="all results as JSON")
    command.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="the report, one HTML file"
    )


def advise(command: Parser) -> None:
    command.add_argument("runs", metavar="RUN", nargs="*", help="recordings so far, CSV")
    _add_vehicle(command)
    command.add_argument(
        "--candidates", metavar="NAME", **SEVERAL, help="known manoeuvres or files; many untold"
    )
    command.add_argument(
        "--planned", metavar="NAME", **SEVERAL, help="manoeuvres that will be driven in any case"
    )
    _add_mappings(command)
    _add_noise(command, "noise of the recordings and, without any, of the sensors")
    command.add_argument("--json", metavar="FILE", help="the advice as JSON")


def _add_data(command: Parser) -> None:
    command.add_argument("--data", metavar="DIR", type=Path, help="where sessions are kept")


def _add_identification(command: Parser) -> None:
    """Recordings, a car, and what is identified how."""
    command.add_argument("runs", metavar="RUN", nargs="+", help="recording")
    _add_mappings(command)
    _add_vehicle(command)
    command.add_argument("--free", metavar="NAME", **SEVERAL, help="identify these alone")
    command.add_argument("--fixed", metavar="NAME", **SEVERAL, help="identify all but these")
    command.add_argument(
        "--damper",
        choices=("linear", "two-slope"),
        help="two-slope: identify rebound ratios and knee speeds, too",
    )
    command.add_argument("--bounds", metavar="NAME=LOW:HIGH", **SEVERAL, help="SI units")
    command.add_argument("--start", metavar="NAME=VALUE", **SEVERAL, help="SI units")
    command.add_argument("--starts", metavar="N", help="try so many starts between the bounds")
    command.add_argument("--seed", metavar="N", type=_seed, help="other starts")
    command.add_argument(
        "--loss", choices=get_args(LossName), help="how much outliers count; linear unless told"
    )
    command.add_argument(
        "--loss-scale", metavar="NOISES", help="from which on they count less; 3 unless told"
    )
    command.add_argument(
        "--prior",
        metavar="NAME=VALUE~DEVIATION",
        **SEVERAL,
        help="known from a drawing, SI units; or ~PERCENT%%",
    )
    command.add_argument(
        "--sensor",
        metavar="CHANNEL.QUANTITY=VALUE",
        **SEVERAL,
        help="what a sensor is known to do: delay, gain, bias, sign or noise, SI units",
    )
    command.add_argument(
        "--fit-sensor",
        metavar="CHANNEL.QUANTITY",
        **SEVERAL,
        help="identify it too: delay, gain, bias or noise",
    )
    command.add_argument(
        "--fit-noise", action="store_true", help="identify the noise of all compared channels"
    )
    _add_rims_mode(command, "--braking lap_2.csv=6.2:9.8")
    _add_step(command, "5 ms unless told")
    _add_noise(command, "noise of the recordings")


def campaign(command: Parser) -> None:
    command.add_argument(
        "--plant",
        choices=tuple(PLANTS),
        default="concept",
        help="car to drive; detailed: the multibody car, some minutes a drive",
    )
    command.add_argument("--vehicle", metavar="FILE", help="the concept car; paper unless told")
    command.add_argument(
        "--manoeuvre",
        metavar="NAME",
        nargs="+",
        action="extend",
        help="1 2 brake-54 bump constant-speed-c unless told; or files",
    )
    command.add_argument(
        "--class-factor", metavar="X", type=float, help="power of random roads; 0.5: lower limit"
    )
    command.add_argument("--band", metavar="LOW:HIGH", help="of random roads, cycle/m")
    command.add_argument("--road-seed", metavar="N", type=_seed, help="other random roads")
    command.add_argument("--sensors", metavar="FILE", help="the sensors, TOML or JSON")
    _add_noise(command, "noise of the usual sensors")
    command.add_argument("--seed", metavar="N", type=_seed, default=0, help="of the noise")
    command.add_argument(
        "--format", choices=("csv", "mf4"), default="csv", dest="form", help="csv unless told"
    )
    command.add_argument("--date", metavar="DATE", help="of the drives; now unless told")
    command.add_argument(
        "--processes", metavar="N", type=int, help="one a core unless told, or none besides this"
    )
    command.add_argument("-o", "--output", metavar="DIR", required=True, help="folder to fill")
    command.add_argument("--force", action="store_true", help="write over files that are there")


def bench(command: Parser) -> None:
    command.add_argument(
        "--service",
        action="store_true",
        help="a service under load in place of the engine: what its users wait for, what they cost",
    )
    command.add_argument(
        "--only", metavar="NAME", nargs="+", action="extend", default=[], help="these rows alone"
    )
    command.add_argument(
        "--quick", action="store_true", help="fewer repetitions, and no start-up rows"
    )
    command.add_argument("-o", "--output", metavar="FILE", help="the table as JSON")


def _add_excitation(command: Parser) -> None:
    """A vehicle and what drives it."""
    _add_vehicle(command)
    drive = command.add_mutually_exclusive_group(required=True)
    drive.add_argument("--manoeuvre", metavar="NAME", help="1, 2, another known one, or a file")
    drive.add_argument("--rims", metavar="RUN", help="recording whose rims and a_x drive the car")
    drive.add_argument("--posts", metavar="RUN", help="recording of a four-post rig's post.*.z")
    _add_mapping(command)
    command.add_argument("--road", metavar="FILE", help="road file in place of the manoeuvre's")
    command.add_argument("--duration", metavar="S", type=float, help="in place of the manoeuvre's")
    command.add_argument("--lift-off", action="store_true", help="no tyre pulls at the road")
    _add_rims_mode(command, "--braking 6.2:9.8")
    _add_step(command, "2.5 ms unless told, 1.25 ms of two-slope dampers, 5 ms with --rims")


def _add_vehicle(command: Parser) -> None:
    command.add_argument(
        "--vehicle", metavar="FILE", required=True, help="vehicle or fit file, or a known car"
    )


def _add_rims_mode(command: Parser, example: str) -> None:
    """How the recordings drive the model; see engine.rims_settings for what holds untold."""
    compared = "z, pitch and roll, recorded and simulated; none unless told"
    command.add_argument("--traction", choices=("exact", "paper"), help="exact unless told")
    command.add_argument(
        "--initial-state",
        choices=("equilibrium", "measured"),
        help="of the body; equilibrium unless told",
    )
    for option, what in (
        ("--a-x-cutoff", "low-pass of a_x, 20 unless told"),
        ("--rim-cutoff", "low-pass of the wheels, 50 unless told"),
        ("--output-cutoff", f"low-pass of {compared}"),
        ("--output-highpass", f"high-pass of {compared}"),
    ):
        command.add_argument(option, metavar="HZ|none", help=what)
    command.add_argument(
        "--braking",
        metavar="BEGIN:END",
        nargs="+",
        action="extend",
        help=f"when the car brakes, s, in place of what a_x shows; e.g. {example}; none for never",
    )


def _add_step(command: Parser, untold: str) -> None:
    command.add_argument(
        "--step", metavar="S", type=float, help=f"longest integration step, s; {untold}"
    )


def _add_list_and_remove(command: Parser, listed: str, removed: str) -> None:
    """Two actions; `listed` and `removed` say what they do."""
    actions = command.add_subparsers(metavar="list|remove", dest="action", required=True)
    command.commands = actions.choices
    shown = actions.add_parser("list", help=listed)
    remove = actions.add_parser("remove", help=removed)
    remove.add_argument("ids", metavar="ID", nargs="+", help="as the list shows it")
    for action in (shown, remove):
        _add_data(action)


def _add_noise(command: Parser, what: str) -> None:
    command.add_argument("--noise", metavar="FILE", help=f"{what}, TOML with a [noise] table")


def _add_mapping(command: Parser) -> None:
    command.add_argument(
        "--mapping", metavar="FILE", help="which columns are which channels; see ridetune channels"
    )


def _add_mappings(command: Parser) -> None:
    command.add_argument(
        "--mapping",
        metavar="FILE|RUN=FILE",
        **SEVERAL,
        help="which columns are which channels, of all runs or of one; see ridetune channels",
    )


def _seed(text: str) -> int:
    seed = int(text) if text.isdecimal() else -1
    if not 0 <= seed <= LARGEST_SEED:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 0 to {LARGEST_SEED}")
    return seed
