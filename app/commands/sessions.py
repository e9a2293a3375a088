"""`ridetune sessions`: which sessions the service keeps, and an end of some."""

from argparse import Namespace
from collections.abc import Sequence

from ..settings import Settings
from ..storage.file_store import FileStore
from ..storage.kept_sessions import KeptSession, KeptSessions
from ..storage.originals import Originals
from .kept import kept, place
from .output import minute, print_table


def sessions(options: Namespace) -> None:
    """List all sessions, or delete some with all they hold."""
    settings = Settings.from_environment(data=options.data)
    with kept(settings, files=options.action == "remove") as database:
        files = FileStore(database, Originals(settings.data), settings.limits)
        store = KeptSessions(database, files)
        if options.action == "remove":
            store.remove(options.ids)
            print(
                f"Deleted with all they held: {', '.join(options.ids)}. A running service stops "
                "their jobs within some seconds."
            )
        elif known := store.list():
            _print(known)
        else:
            print(
                f"There is no session in {place(settings)}; another directory is named with --data."
            )


def _print(known: Sequence[KeptSession]) -> None:
    rows = (
        (
            session.id,
            _owner(session.owner),
            minute(session.created),
            minute(session.seen),
            str(session.measurements),
            str(session.jobs),
            f"{session.bytes / 1e6:.1f}",
            _on_a_line(session.name),
        )
        for session in known
    )
    head = ("id", "owner", "created", "used last", "recordings", "jobs", "MB of files", "name")
    print_table([head, *rows], right=(4, 5, 6))


def _owner(owner: str | None) -> str:
    """A user as a person calls them."""
    if owner is None:
        return "a browser"
    kind, _, name = owner.partition(":")
    return f"{kind} {_on_a_line(name)}"


def _on_a_line(name: str) -> str:
    """A name on one line, whatever a proxy or a visitor has sent."""
    return "".join(letter if letter.isprintable() else "?" for letter in name)
