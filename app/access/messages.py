"""Pages that a person meets in place of the one they wanted, each with what to do next."""

from html import escape
from string import Template

from fastapi.responses import HTMLResponse
from starlette.requests import Request

from ..package_files import package_folder
from ..settings import Settings
from ..storage.browser_store import BROWSER_SECONDS, LINK_SECONDS
from .invitation import visitors_link_command

DAYS = round(BROWSER_SECONDS / 86400)
HOURS = round(LINK_SECONDS / 3600)
UNSAID = {"Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}
"""Of pages whose address may hold a token."""


def not_let_in(request: Request, settings: Settings) -> HTMLResponse:
    """Who comes without anything that lets them in."""
    return _page(
        "This browser has not been let in yet",
        _text("The cars and recordings here are for those who were let in."),
        *_ways_in(request, settings),
    )


def link_used_up(request: Request, settings: Settings) -> HTMLResponse:
    """Who comes with a link that lets nobody in any more."""
    return _page(
        "This link has been used, or is too old",
        _text(
            f"A link lets one browser in, once and within {HOURS} hours. If it was this browser "
            "that it let in, go on to the page; any other needs a link of its own."
        ),
        _button("/", "Go on to the page"),
        *_ways_in(request, settings),
    )


def no_such_session() -> HTMLResponse:
    """Who comes to a session that is not theirs, or is gone."""
    return _page(
        "This session is not here",
        _text(
            "It has been deleted, or it belongs to another browser or user. A session opens only "
            "where it was begun, or for the user who signed in for it; its address alone is not "
            "enough."
        ),
        _button("/", "Open a session of your own"),
        status=404,
    )


def knock_again(request: Request) -> HTMLResponse:
    """Let the browser ask again from our own page, with its cookies."""
    query = f"?{request.url.query}" if request.url.query else ""
    address = escape(request.url.path + query, quote=True)
    return HTMLResponse(
        f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">'
        f'<a href="{address}">Continue to ridetune</a>',
        headers=UNSAID,
    )


def _ways_in(request: Request, settings: Settings) -> list[str]:
    """Everything that lets a person in here."""
    ways = []
    if settings.proxy_user_header:
        place = _link(settings.public_url) if settings.public_url else "its public address"
        ways.append(f"<p>You may sign in at {place}.</p>")
    if settings.token:
        ways.append(
            "<p>You may open it with the service’s token, if you know that, put behind the "
            "address: <code>/?token=…</code></p>"
        )
    ways.append(
        "<p>A new link lets this browser in. Type this in a terminal on the machine where ridetune "
        "runs, and open here what it prints:</p>"
        f"<pre><code>{escape(visitors_link_command(settings))}</code></pre>"
        "<p class=soft>The browser then stays let in, over restarts too, until it has not come "
        f"for {DAYS} days.</p>"
    )
    if request.url.hostname == "localhost" and not settings.public_url:
        port = f":{request.url.port}" if request.url.port else ""
        ways.append(
            "<p class=soft>Let in before? Browsers keep the two names of this machine apart: try "
            f"{_link(f'http://127.0.0.1{port}')}.</p>"
        )
    return ways


def _text(sentence: str) -> str:
    return f"<p>{escape(sentence)}</p>"


def _button(address: str, label: str) -> str:
    return f'<p><a class="button" href="{address}">{escape(label)}</a></p>'


def _link(address: str) -> str:
    return f'<a href="{escape(address)}/">{escape(address)}/</a>'


def _page(title: str, *parts: str, status: int = 403) -> HTMLResponse:
    frame = (package_folder("static") / "message.html").read_text(encoding="utf-8")
    shown = Template(frame).substitute(title=escape(title), body="\n".join(parts))
    return HTMLResponse(shown, status, headers=UNSAID)
