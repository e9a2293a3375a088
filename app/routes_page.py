"""The page, and the way a browser gets its session."""

from html import escape
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse, Response
from starlette.concurrency import run_in_threadpool

from .access import give_session, own_session, require_service_token, session_of
from .errors import Forbidden, NotFound
from .package_files import package_folder
from .services import Shared

router = APIRouter()


@router.get("/", include_in_schema=False)
def start(request: Request, services: Shared) -> Response:
    """Send the browser to its session, a fresh one if it has none."""
    if _came_from_elsewhere(request):
        return _knock_again(request)
    rest = request.query_params
    query = urlencode([pair for pair in rest.multi_items() if pair[0] != "token"])
    suffix = f"?{query}" if query else ""
    if known := own_session(request):
        return RedirectResponse(f"/s/{known}/{suffix}", 303)
    try:
        require_service_token(request, rest.get("token", ""))
    except Forbidden as error:
        return _message("This service asks for its token", str(error), 403)
    response = RedirectResponse("", 303)
    sid, _ = give_session(request, response)
    response.headers["location"] = f"/s/{sid}/{suffix}"
    return response


@router.get("/s/{sid}/", include_in_schema=False)
async def page(sid: str, request: Request) -> Response:
    """The page itself; all it shows it asks of /api."""
    if _came_from_elsewhere(request):
        return _knock_again(request)
    try:
        await run_in_threadpool(session_of, request, sid)
    except NotFound:
        return _message(
            "This session is not here",
            "It has been deleted, or it belongs to another browser.",
            404,
        )
    return FileResponse(package_folder("static") / "index.html")


def _came_from_elsewhere(request: Request) -> bool:
    """A link on another site: the browser keeps our SameSite=Strict cookies back."""
    return request.headers.get("sec-fetch-site") == "cross-site"


def _knock_again(request: Request) -> HTMLResponse:
    """Let the browser ask again from our own page, with its cookies."""
    query = f"?{request.url.query}" if request.url.query else ""
    address = escape(request.url.path + query, quote=True)
    return HTMLResponse(
        f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">'
        f'<a href="{address}">Continue to ridetune</a>'
    )


def _message(title: str, text: str, status: int) -> HTMLResponse:
    return HTMLResponse(
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<body style="font-family: sans-serif; margin: 4rem"><h1>{escape(title)}</h1>'
        f'<p>{escape(text)}</p><p><a href="/">Open a session of your own</a></p>',
        status,
    )
