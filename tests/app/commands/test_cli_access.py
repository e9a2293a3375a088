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
from ridetune.app.limits import Limits
from ridetune.app.settings import Settings
from ridetune.app.storage.recent_answers import SECONDS
from ridetune.app.storage.store import Store

from ..command_line import PROGRAM, refused
from ..conftest import open_client

PATIENCE = 60.0
LINK = r"Open (http://127\.0\.0\.1:\d+)/(\?token=[\w-]{43})\n"


def serve(folder, *options, **environment):
    """`ridetune serve` with data in a folder, on a free port."""
    told = {name: text for name, text in os.environ.items() if "RIDETUNE" not in name}
    command = [
        sys.executable,
        "-u",
        "-c",
        PROGRAM,
        "serve",
        "--port",
        "0",
        "--data",
        folder,
        *options,
    ]
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
    for token, shown in (
        ("open-sesame-open", "the token"),
        ("another-one-by-now", "No browser is let in"),
    ):
        with serve(tmp_path, RIDETUNE_TOKEN=token) as process:
            address = re.search(r"http://[\d.:]+", process.stdout.readline())[0]
            known = httpx2.get(f"{address}/?token=open-sesame-open", timeout=PATIENCE).status_code
            assert known == (303 if token == "open-sesame-open" else 403)
            assert shown in run(capsys, "browsers", "list", "--data", str(tmp_path))
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)


def test_behind_a_proxy_the_terminal_names_the_directory_and_the_page_does_not(tmp_path, capsys):
    """The command that the terminal shows works; visitors are told no paths."""
    with serve(tmp_path, RIDETUNE_PUBLIC_URL="https://ride.example") as process:
        first, second = process.stdout.readline(), process.stdout.readline()
        assert re.match(r"Open https://ride\.example/\?token=", first)
        command = second.rpartition("for another: ")[2].split()
        assert command == ["ridetune", "link", "--data", str(tmp_path)]
        assert "https://ride.example/?token=" in run(capsys, *command[1:])
        process.terminate()  # SIGINT may be ignored until the service has started
        process.communicate(timeout=60)
    settings = Settings(data=tmp_path, public_url="https://ride.example")
    with open_client(settings, login=True) as visitor:
        page = visitor.get("/").text
    assert "ridetune link" in page
    assert str(tmp_path) not in page


def test_the_names_by_which_others_come_are_told_at_the_start(tmp_path):
    """Oracle: what requests are answered by these names, and by another."""
    told = {"RIDETUNE_TOKEN": "open-sesame-open", "RIDETUNE_ALLOWED_HOSTS": "ride.example"}
    with serve(tmp_path, "--host", "0.0.0.0", **told) as process:
        address, sentence = process.stdout.readline(), process.stdout.readline()
        address = re.search(r"http://[\d.:]+", address)[0]
        names = re.match("It answers to the names (.*) alone; RIDETUNE_ALLOWED_HOSTS", sentence)[1]
        assert names.split(", ") == ["127.0.0.1", "[::1]", "localhost", "ride.example"]
        for name in (*names.split(", "), "192.0.2.1"):
            reply = httpx2.get(f"{address}/healthz", headers={"Host": name}, timeout=PATIENCE)
            assert reply.status_code == (403 if name == "192.0.2.1" else 200)
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
        (
            "link --data data",
            "data yet; start one with `ridetune serve`, or name another with --data",
        ),
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
        ("serve --host 0.0.0.0 --port 0 --data data", "`ridetune keys add NAME --data data`"),
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


def test_the_place_in_which_is_looked_is_told(folder, capsys, monkeypatch):
    """A root's key beside a service of /var/lib is of no use, and would not be noticed."""
    monkeypatch.delenv("RIDETUNE_DATABASE", raising=False)
    monkeypatch.setenv("RIDETUNE_DATA", str(folder / "data"))
    assert main(["keys", "add", "rig"]) == 0
    printed = capsys.readouterr()
    assert re.fullmatch(r"rt_[\w-]{43}\n", printed.out)
    assert f"kept in the data directory {folder}/data," in printed.err
    assert main(["keys", "remove", "rig"]) == 0
    for command in (("keys", "list"), ("browsers", "list")):
        assert f"in the data directory {folder}/data; " in run(capsys, *command)


def test_a_key_of_a_shared_database_is_said_to_be_there(capsys, monkeypatch, on_postgresql):
    monkeypatch.setenv("RIDETUNE_DATABASE", on_postgresql)
    assert main(["keys", "add", "rig"]) == 0
    assert "kept in the database of RIDETUNE_DATABASE," in capsys.readouterr().err


def test_other_users_do_not_look_into_a_new_data_directory(folder):
    assert main(["keys", "add", "rig", "--data", "data"]) == 0
    assert (folder / "data").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize(
    "command",
    ["keys add rig", "keys list", "link", "browsers list", "backup -o backup.zip"],
)
def test_a_directory_of_postgresql_is_refused_without_its_database(
    folder, capsys, monkeypatch, on_postgresql, command
):
    """As the service refuses it; a key would go where no service looks. Oracle: the folder."""
    monkeypatch.delenv("RIDETUNE_DATABASE", raising=False)
    Store(folder / "data", Limits(), on_postgresql).close()
    before = set(folder.rglob("*"))
    told = refused(capsys, *command.split(), "--data", "data")
    assert "data belongs to a PostgreSQL database; name it in RIDETUNE_DATABASE" in told
    assert told == refused(capsys, "serve", "--port", "0", "--data", "data")
    assert set(folder.rglob("*")) == before


@pytest.mark.parametrize("command", ["keys list", "backup -o backup.zip"])
def test_a_directory_of_another_database_is_refused(
    folder, capsys, monkeypatch, on_postgresql, postgresql, command
):
    Store(folder / "data", Limits(), on_postgresql).close()
    with postgresql.database() as another:
        Store(folder / "other", Limits(), another).close()
        monkeypatch.setenv("RIDETUNE_DATABASE", another)
        told = refused(capsys, *command.split(), "--data", "data")
    assert "data belongs to another PostgreSQL database" in told


def test_a_database_that_lies_beside_the_mark_keeps_no_service_away(tmp_path, on_postgresql):
    """It is not the directory's: with the mark no service uses SQLite there."""
    Store(tmp_path, Limits(), on_postgresql).close()
    (tmp_path / "ridetune.sqlite").touch()
    Store(tmp_path, Limits(), on_postgresql).close()
