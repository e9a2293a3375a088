"""`ridetune link`: a link that lets one more browser into the service."""

from argparse import Namespace

from ..access import invitation
from ..settings import Settings
from ..storage.browser_store import BrowserStore
from .kept import kept


def link(options: Namespace) -> None:
    """Print a link to where the service was found last."""
    settings = Settings.from_environment(data=options.data)
    with kept(settings) as database:
        address = invitation.last_address(settings)
        print(f"Open {invitation.link(address, BrowserStore(database).make_link())}")
