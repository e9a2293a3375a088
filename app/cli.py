"""`ridetune`: every job of the engine as a command, and the service.

A command prints its report on standard output and writes its file with -o. Exit status 0 is
success; 2 is an input that the caller can mend, told in one line on standard error. The engine is
imported by the command that runs, so that help is quick.
"""

import argparse
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, NoReturn

from ..engine.errors import RideError
from .commands import options as takes
from .commands.parser import BAD_INPUT, Parser

INTERRUPTED = 130  # 128 + SIGINT, as shells report it
PIPE_CLOSED = 141  # 128 + SIGPIPE
TERMINATED = 143  # 128 + SIGTERM


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = command_line()
    parser.refuse_unknown(arguments)
    options = parser.parse_args(arguments)
    try:
        with _termination_interrupts():
            options.run(options)
        sys.stdout.flush()
    except RideError as error:
        print("ridetune:", " ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except _Terminated:
        return TERMINATED
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # The interpreter flushes once more at its end; let that go nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    return 0


class _Terminated(KeyboardInterrupt):
    """SIGTERM has arrived."""


@contextmanager
def _termination_interrupts() -> Iterator[None]:
    """SIGTERM goes the way of an interrupt, so that no half file and no process is left behind."""

    def raise_it(number: int, frame: object) -> NoReturn:
        raise _Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kept = signal.signal(signal.SIGTERM, raise_it)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, kept)


def command_line() -> Parser:
    """The parser of all commands; `options.run` is the chosen one."""
    parser = Parser(prog="ridetune", description="Tune the ride of a car from measurements.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {version('ridetune')}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    parser.commands = commands.choices

    def add(name: str, run: Any, summary: str) -> Parser:
        command = commands.add_parser(name, help=summary, description=summary)
        command.set_defaults(run=run)
        return command

    takes.serve(add("serve", _serve, "Serve the page and the REST interface."))
    takes.link(add("link", _link, "Make a link that lets one more browser in."))
    takes.browsers(add("browsers", _browsers, "Show and end the browsers that are let in."))
    takes.sessions(add("sessions", _sessions, "Show and delete the sessions that are kept."))
    takes.keys(add("keys", _keys, "Make, show and end the API keys of programs."))
    takes.simulate(add("simulate", _simulate, "Simulate a car on a road, from rims or posts."))
    takes.channels(add("channels", _channels, "Show which channels a recording's columns are."))
    takes.sweep(add("sweep", _sweep, "Simulate many cars, one row a car."))
    takes.condition(add("condition", _condition, "Make a fit's inputs of a raw recording."))
    takes.identify(add("identify", _identify, "Identify a car's parameters from recordings."))
    takes.validate(add("validate", _validate, "Identify a car and report what it predicts."))
    takes.advise(add("advise", _advise, "Tell which manoeuvre to drive next."))
    takes.campaign(add("campaign", _campaign, "Measure a car that is known, as files."))
    takes.backup(add("backup", _backup, "Copy everything that a service keeps into one file."))
    takes.restore(add("restore", _restore, "Restore a backup into an empty directory."))
    takes.bench(add("bench", _bench, "Measure the engine and its peers, or the service."))
    return parser


def _compiling(run: Callable[[argparse.Namespace], None]) -> Callable[[argparse.Namespace], None]:
    """A command that tells when it compiles kernels, which takes a while."""

    def told(options: argparse.Namespace) -> None:
        from .compile import compiling_told

        with compiling_told():
            run(options)

    return told


def _serve(options: argparse.Namespace) -> None:
    from .settings import Settings
    from .simulators.forking import load_early

    settings = Settings.from_environment(
        host=options.host, port=options.port, data=options.data, login=options.login
    )
    load_early(settings.data)

    from .serve import serve

    serve(settings)


def _link(options: argparse.Namespace) -> None:
    from .commands.link import link

    link(options)


def _browsers(options: argparse.Namespace) -> None:
    from .commands.browsers import browsers

    browsers(options)


def _sessions(options: argparse.Namespace) -> None:
    from .commands.sessions import sessions

    sessions(options)


def _keys(options: argparse.Namespace) -> None:
    from .commands.keys import keys

    keys(options)


@_compiling
def _simulate(options: argparse.Namespace) -> None:
    from .commands.simulate import simulate

    simulate(options)


def _channels(options: argparse.Namespace) -> None:
    from .commands.channels import channels

    channels(options)


@_compiling
def _sweep(options: argparse.Namespace) -> None:
    from .commands.sweep import sweep

    sweep(options)


def _condition(options: argparse.Namespace) -> None:
    from .commands.condition import condition

    condition(options)


@_compiling
def _identify(options: argparse.Namespace) -> None:
    from .commands.identify import identify

    identify(options)


@_compiling
def _validate(options: argparse.Namespace) -> None:
    from .commands.validate import validate

    validate(options)


@_compiling
def _advise(options: argparse.Namespace) -> None:
    from .commands.advise import advise

    advise(options)


@_compiling
def _campaign(options: argparse.Namespace) -> None:
    from .commands.campaign import campaign

    campaign(options)


def _backup(options: argparse.Namespace) -> None:
    from .commands.backup import backup

    backup(options)


def _restore(options: argparse.Namespace) -> None:
    from .commands.backup import restore

    restore(options)


def _bench(options: argparse.Namespace) -> None:
    from .commands.bench import bench

    bench(options)
