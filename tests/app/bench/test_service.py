"""The measurements of the service: their figures, their table, their own HTTP."""

import asyncio

import numpy as np
import pytest
from ridetune.app.bench.service.connection import Connection, Unexpected, request
from ridetune.app.bench.service.figure import Figure, Measured, percentile
from ridetune.app.bench.service.run import ServiceReport, report_to_json, table
from ridetune.app.cli import main

from ..loop import in_a_loop


@pytest.mark.parametrize("count", [1, 2, 99, 100, 101])
def test_a_percentile_is_the_least_value_that_so_many_do_not_exceed(count):
    """Oracle: NumPy's inverse of the empirical distribution."""
    values = np.random.default_rng(count).normal(size=count)
    for percent in (50, 95, 99):
        expected = np.percentile(values, percent, method="inverted_cdf")
        assert percentile(list(values), percent) == expected


def test_the_table_says_which_targets_are_met():
    figures = (
        Figure("wait p95", 0.0123, "s", most=0.1),
        Figure("small", 1500.0, "1/s", least=2000.0),
        Figure("memory", 2.5e9, "B"),
    )
    report = ServiceReport({"cores": 2}, {"row": Measured("what", figures, load=0.5)})
    assert table(report)[1:] == [
        ("row", "wait p95", "12.3 ms", "< 100 ms", "yes"),
        ("", "small", "1500 /s", "> 2000 /s", "no"),
        ("", "memory", "2.5 GB", "", ""),
    ]
    [row] = report_to_json(report)["rows"]
    assert (row["name"], row["load_average"]) == ("row", 0.5)
    assert [figure["met"] for figure in row["figures"]] == [True, False, None]


def test_a_connection_serves_many_requests_and_says_what_was_refused():
    """Oracle: what a server that knows nothing of us got and gave."""
    got = []

    async def answer(reader, writer):
        for status in (b"200 OK", b"404 Not Found"):
            head = await reader.readuntil(b"\r\n\r\n")
            got.append((head, await reader.readexactly(9)))
            writer.write(b"HTTP/1.1 " + status + b'\r\nContent-Length: 2\r\n\r\n"a"'[:-1])
        writer.close()

    async def asked():
        server = await asyncio.start_server(answer, "127.0.0.1", 0)
        async with server:
            connection = Connection(server.sockets[0].getsockname()[1])
            sent = request("POST", "/here", "secret", {"car": 7})
            assert (await connection.wanted(sent)).body == b'"a'
            with pytest.raises(Unexpected, match=r"POST /here HTTP/1\.1 with 404"):
                await connection.wanted(sent)
            connection.close()

    in_a_loop(asked)
    assert [body for _, body in got] == [b'{"car":7}'] * 2
    assert b"Authorization: Bearer secret\r\n" in got[0][0]


def test_a_row_of_the_other_bench_is_refused(capsys):
    assert main(["bench", "--service", "--only", "road-one"]) == 2
    assert "there is no row of that name; there are slider, hello" in capsys.readouterr().err
