"""`ridetune link`, `browsers` and `keys` beside a service that runs, and what `serve` prints."""

import os
import re
import signal
import subprocess
import sys
import time

import httpx2
import pytest
from ridetune.app.cli import main
from ridetune.app.recent_answers import SECONDS

from .command_line import PROGRAM, refused

PATIENCE = 60.0
LINK = r"Open (http://127\.0\.0\.1:\d+)/(\?token=[\w-]{43})\n"


def serve(folder, **environment):
    """`ridetune serve` with data in a folder, on a free port."""
    told = {name: text for name, text in os.environ.items() if "RIDETUNE" not in name}
    command = [sys.executable, "-u", "-c", PROGRAM, "serve", "--port", "0", "--data", folder]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=told | environment,
    )


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    """Its first line, its data, and at the end all that it said."""
    data = tmp_path_factory.mktemp("access") / "data"
    with serve(data) as process:
        yield process.stdout.readline(), data
        process.send_signal(signal.SIGINT)
        rest, log = process.communicate(timeout=60)
    assert "token=" not in rest
    assert log == ""


def run(capsys, *arguments):
    """What a command prints."""
    assert main(arguments) == 0
    return capsys.readouterr().out


def test_serve_prints_a_link_that_lets_in(service):
    address, token = re.fullmatch(LINK, service[0]).groups()
    with httpx2.Client(base_url=address, timeout=PATIENCE) as browser:
        assert browser.get("/").status_code == 403
        assert browser.get(f"/{token}").status_code == 303
        assert browser.post("/api/sessions").status_code == 201


def test_another_link_leads_to_the_running_service(service, capsys):
    printed = run(capsys, "link", "--data", str(service[1]))
    address, token = re.fullmatch(LINK, printed).groups()
    assert address in service[0]
    assert httpx2.get(f"{address}/{token}", timeout=PATIENCE).status_code == 303


def test_keys_come_and_go_beside_the_running_service(service, capsys):
    data = ("--data", str(service[1]))
    assert main(["keys", "add", "rig 3", *data]) == 0
    key = capsys.readouterr().out.strip()
    address = re.match(LINK, service[0])[1]
    brought = {"Authorization": f"Bearer {key}"}
    assert (
        httpx2.post(f"{address}/api/sessions", headers=brought, timeout=PATIENCE).status_code == 201
    )
    [_, row] = run(capsys, "keys", "list", *data).splitlines()
    assert re.fullmatch(r"rig 3 +rt_[\w-]{6}\.\.\. +[\d: -]{16} +[\d: -]{16}", row)
    assert key not in row
    assert "rig 3" in run(capsys, "keys", "remove", "rig 3", *data)
    assert (
        httpx2.post(f"{address}/api/sessions", headers=brought, timeout=PATIENCE).status_code == 401
    )


def test_a_browser_is_ended_beside_the_running_service(service, capsys):
    """Within a second, as the documents say."""
    data = ("--data", str(service[1]))
    before = run(capsys, "browsers", "list", *data).splitlines()
    address, token = re.fullmatch(LINK, run(capsys, "link", *data)).groups()
    with httpx2.Client(base_url=address, timeout=PATIENCE) as browser:
        assert browser.get(f"/{token}").status_code == 303
        assert browser.post("/api/sessions").status_code == 201
        [row] = set(run(capsys, "browsers", "list", *data).splitlines()[1:]) - set(before)
        known = re.fullmatch(r"([0-9a-f]{12})  a link +[\d: -]{16}  [\d: -]{16}", row)[1]
        assert known in run(capsys, "browsers", "remove", known, *data)
        time.sleep(SECONDS)
        assert browser.post("/api/sessions").status_code == 403
    assert row not in run(capsys, "browsers", "list", *data)


def test_a_service_with_another_token_shows_no_browser_of_the_former_one(tmp_path, capsys):
    for token, shown in (("sesame", "the token"), ("another", "No browser is let in")):
        with serve(tmp_path, RIDETUNE_TOKEN=token) as process:
            address = re.search(r"http://[\d.:]+", process.stdout.readline())[0]
            known = httpx2.get(f"{address}/?token=sesame", timeout=PATIENCE).status_code
            assert known == (303 if token == "sesame" else 403)
            assert shown in run(capsys, "browsers", "list", "--data", str(tmp_path))
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)


def test_nobody_forwards_themselves_into_the_proxys_place(tmp_path):
    """The address that counts is that of the connection, whatever is said of others."""
    proxy = {
        "RIDETUNE_PROXY_USER_HEADER": "X-Forwarded-User",
        "RIDETUNE_PROXY_ADDRESSES": "10.0.0.1",
    }
    with serve(tmp_path, **proxy) as process:
        address = re.search(r"http://[\d.:]+", process.stdout.readline())[0]
        forged = {"X-Forwarded-User": "anna", "X-Forwarded-For": "10.0.0.1"}
        assert (
            httpx2.get(f"{address}/api/sessions", headers=forged, timeout=PATIENCE).status_code
            == 403
        )
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("link --data none", "No service has used the data directory none"),
        ("keys list --data none", "No service has used the data directory none"),
        ("keys", "add|list|remove"),
        ("keys ad rig", "did you mean add?"),
        ("keys add", "NAME"),
        ("browsers", "list|remove"),
        ("browsers remove", "ID"),
        ("browsers list --data none", "No service has used the data directory none"),
        ("browsers remove 0123 --data data", "there is no browser '0123'"),
        ("keys remove rig --data data", "there is no key 'rig'"),
        ("keys add rig --data data/file", "cannot be used"),
        ("serve --host 0.0.0.0 --no-login --port 0 --data data", "without login"),
        ("serve --host 0.0.0.0 --port 0 --data data", "ridetune keys add"),
    ],
)
def test_a_wrong_command_is_refused_in_one_line(folder, capsys, monkeypatch, command, told):
    for name in [name for name in os.environ if name.startswith("RIDETUNE_")]:
        monkeypatch.delenv(name)
    assert main(["keys", "add", "bench", "--data", "data"]) == 0
    assert main(["keys", "remove", "bench", "--data", "data"]) == 0
    (folder / "data" / "file").touch()
    capsys.readouterr()
    assert told.lower() in refused(capsys, *command.split()).lower()
    assert not (folder / "none").exists()


def test_other_users_do_not_look_into_a_new_data_directory(folder):
    assert main(["keys", "add", "rig", "--data", "data"]) == 0
    assert (folder / "data").stat().st_mode & 0o777 == 0o700
