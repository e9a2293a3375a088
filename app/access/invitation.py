"""How a person gets in: links, and the command that makes one."""

import os
import shlex
import shutil
import sys
from pathlib import Path
from urllib.parse import quote

from ..addresses import is_loopback
from ..errors import StartError
from ..settings import Settings, usual_data


def note_address(settings: Settings, address: str) -> None:
    """Keep with the data where the service is found."""
    (settings.data / "address").write_text(f"{address}\n")


def last_address(settings: Settings) -> str:
    """Where a service with these data was found last."""
    try:
        return (settings.data / "address").read_text().strip()
    except FileNotFoundError:
        raise StartError(
            f"No service has run with the data directory {settings.data} yet; start one with "
            "`ridetune serve`, or name another with --data."
        ) from None


def link(address: str, secret: str) -> str:
    """The link that lets a browser in."""
    return f"{address}/?token={quote(secret)}"


def visitors_link_command(settings: Settings) -> str:
    """What makes a link, as a page tells it: who comes from other machines is told no paths of
    this one.
    """
    if settings.public_url or settings.allowed_hosts or not is_loopback(settings.host):
        return "ridetune link"
    return link_command(settings)


def link_command(settings: Settings) -> str:
    """What makes a link, as it can be typed on this machine."""
    elsewhere = settings.data.absolute() != usual_data(os.environ).absolute()
    data = ["--data", str(settings.data.absolute())] if elsewhere else []
    return shlex.join([_program(), "link", *data])


def _program() -> str:
    started = Path(sys.argv[0])
    if started.name != "ridetune" or shutil.which("ridetune") == str(started):
        return "ridetune"
    return str(started.absolute())
