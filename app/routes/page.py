"""The page, and the way a browser gets its session."""

from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, RedirectResponse, Response
from starlette.concurrency import run_in_threadpool

from ..access import cookies, messages
from ..access.login import is_let_in, let_in
from ..access.sessions import give_session, opened_session, own_sessions
from ..errors import NotFound
from ..package_files import package_folder
from ..web.heads import wants_head_alone
from ..web.services import Shared

router = APIRouter()


@router.get("/", include_in_schema=False)
def start(request: Request, services: Shared) -> Response:
    """Send the browser to its session, a fresh one if it has none; a token in the address goes."""
    if _came_from_elsewhere(request):
        return messages.knock_again(request)
    rest = request.query_params.multi_items()
    token = request.query_params.get("token", "")
    query = urlencode([pair for pair in rest if pair[0] != "token"])
    response = RedirectResponse("", 303)
    alone = wants_head_alone(request)
    opened = bool(token) and not alone and let_in(request, response, token)
    if own := own_sessions(request):
        sid = own[0].id
    elif alone and is_let_in(request):
        return Response()  # a GET leads to a fresh session
    elif opened or is_let_in(request):
        sid = give_session(request, response)["id"]
    elif token:
        return messages.link_used_up(request, services.settings)
    else:
        return messages.not_let_in(request, services.settings)
    response.headers["location"] = f"/s/{sid}/?{query}" if query else f"/s/{sid}/"
    return response


@router.get("/s/{sid}/", include_in_schema=False)
async def page(sid: str, request: Request, services: Shared) -> Response:
    """The page itself; all it shows it asks of /api. What was opened last, `/` leads to."""
    if _came_from_elsewhere(request):
        return messages.knock_again(request)
    try:
        await opened_session(request, sid)
    except NotFound:
        return messages.no_such_session()
    if not wants_head_alone(request):
        await run_in_threadpool(services.store.owners.note_use, sid)
    response = FileResponse(package_folder("static") / "index.html")
    cookies.renew(request, response, sid)
    return response


def _came_from_elsewhere(request: Request) -> bool:
    """A link on another site: the browser keeps our SameSite=Strict cookies back."""
    return request.headers.get("sec-fetch-site") == "cross-site"
