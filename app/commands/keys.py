"""`ridetune keys`: the API keys with which programs use the service."""

import sys
from argparse import Namespace
from collections.abc import Sequence

from ..settings import Settings
from ..storage.key_store import Key, KeyStore
from .kept import kept, place
from .output import minute, print_table


def keys(options: Namespace) -> None:
    """Add a key, list what is known of all, or end one."""
    settings = Settings.from_environment(data=options.data)
    with kept(settings, new=options.action == "add") as database:
        store = KeyStore(database)
        if options.action == "add":
            print(store.add(options.name))
            print(
                f"It is kept in {place(settings)}, and shown this once; send it to the service "
                "there as Authorization: Bearer ...",
                file=sys.stderr,
            )
        elif options.action == "remove":
            store.remove(options.name)
            print(f"The key {options.name!r} is ended; its sessions wait for a key of that name.")
        elif known := store.list():
            _print(known)
        else:
            print(
                f"There is no key in {place(settings)}; `ridetune keys add NAME` makes one, "
                "another directory is named with --data."
            )


def _print(known: Sequence[Key]) -> None:
    rows = (
        (
            key.name,
            f"{key.begins}...",
            minute(key.created),
            "never" if key.used is None else minute(key.used),
        )
        for key in known
    )
    print_table([("name", "key", "made", "used last"), *rows])
