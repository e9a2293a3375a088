"""Odd names in every part of an address: nothing is there, nothing fails, nothing changes."""

import pytest

from .session_routes import Route, routes

ODD = {
    "the folder above": "%2e%2e",
    "a way up": "%2e%2e%2f%2e%2e%2fridetune.sqlite",
    "a drive": "C:%5c..%5cridetune.sqlite",
    "a device": "CON",
    "NUL": "x%00.csv",
    "300 bytes": "x" * 300,
    "right to left": "%E2%80%AEvsc.x",
    "half a character": "%ED%A0%80",
    "a line end": "%0d%0aSet-Cookie:%20x=1",
}
OUTSIDE = [
    Route("GET", "/api/vehicles/{key}"),
    Route("GET", "/api/manoeuvres/{key}"),
    Route("GET", "/s/{sid}/"),
    Route("GET", "/s/{sid}/viewer/"),
    Route("GET", "/static/{name}"),
    Route("GET", "/static/vendor/{name}"),
    Route("GET", "/{name}"),
]


@pytest.mark.parametrize("name", ODD.values(), ids=ODD)
def test_an_odd_name_is_that_of_nothing(visitor, name):
    run = visitor.get("/measurements").json()[0]["id"]
    known = {"sid": visitor.id, "mid": run, "jid": "x", "name": "x", "form": "csv", "key": "x"}
    before, wrong = visitor.get().json(), []
    headers = {"Authorization": f"Bearer {visitor.token}"}
    for route in [*routes(visitor.client.app), *OUTSIDE]:
        for place in route.names:
            address = route.filled(known | {place: name})
            reply = visitor.client.request(
                route.method, address, headers=headers, **route.request()
            )
            refused = (404, 422) if place == "form" else (404,)
            if reply.status_code not in refused or "set-cookie" in reply.headers:
                wrong.append((route.method, route.path, place, reply.status_code))
    assert wrong == []
    assert visitor.get().json() == before
