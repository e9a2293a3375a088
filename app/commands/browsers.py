"""`ridetune browsers`: which browsers were let into the service, and an end of that."""

from argparse import Namespace
from collections.abc import Sequence

from ..settings import Settings
from ..storage.browser_store import Browser, BrowserStore
from .kept import kept, place
from .output import minute, print_table


def browsers(options: Namespace) -> None:
    """List what is known of the browsers that are let in, or end some of them."""
    settings = Settings.from_environment(data=options.data)
    with kept(settings) as database:
        store = BrowserStore(database)
        if options.action == "remove":
            store.remove(options.ids)
            print(
                f"Ended: {', '.join(options.ids)}. A session that such a browser has begun stays "
                "open to it until `ridetune sessions remove` deletes it, or somebody in it."
            )
        elif known := store.list():
            _print(known)
        else:
            print(
                f"No browser is let in by what is kept in {place(settings)}; `ridetune link` makes "
                "a link that lets one in, another directory is named with --data."
            )


def _print(known: Sequence[Browser]) -> None:
    rows = (
        (
            browser.id,
            "the token" if browser.by_token else "a link",
            minute(browser.created),
            minute(browser.came),
        )
        for browser in known
    )
    print_table([("id", "let in by", "on", "came last"), *rows])
