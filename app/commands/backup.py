"""`ridetune backup` and `ridetune restore`: everything that a service keeps, as one file."""

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager

from ...engine.units import counted
from ..settings import Settings
from ..storage.backup import Kept, back_up
from ..storage.restore import restore as restore_backup
from .output import require_place, whole_file


def backup(options: argparse.Namespace) -> None:
    """Write the file and say what is in it."""
    settings = Settings.from_environment(data=options.data)
    require_place(options.output, [settings.data / "ridetune.sqlite"])
    # It has the sessions' cars and recordings, which are nobody else's.
    with _private(), whole_file(options.output) as stream:
        kept = back_up(settings, stream)
    print(f"{options.output} holds {_told(kept)}.")


def restore(options: argparse.Namespace) -> None:
    """Restore the file and say what was in it."""
    settings = Settings.from_environment(data=options.data)
    kept = restore_backup(options.backup, settings)
    where = "the database of RIDETUNE_DATABASE and " if settings.database else ""
    print(f"Restored to {where}{settings.data}: {_told(kept)}.")


def _told(kept: Kept) -> str:
    return (
        f"{counted(kept.sessions, 'session')} with {counted(kept.measurements, 'measurement')} and "
        f"{counted(kept.jobs, 'job')}, {counted(kept.files, 'file')} of {kept.bytes / 1e6:.1f} MB"
    )


@contextmanager
def _private() -> Iterator[None]:
    """Files that are made meanwhile are the user's alone."""
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)
