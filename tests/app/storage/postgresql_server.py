"""A PostgreSQL server of the tests' own, in a temporary folder and reached by a socket in it."""

import glob
import os
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
import pytest

MISSING = "The tests need PostgreSQL's initdb; run apt-get install postgresql."


class PostgresqlServer:
    """Its superuser is called ridetune; a test may stop it and start it again.

    What it keeps need not survive a power cut.
    """

    def __init__(self):
        self._bin = _binaries()
        # The server refuses to run as root, and cannot enter pytest's folders.
        self._user = {"user": "postgres", "group": "postgres"} if os.geteuid() == 0 else {}
        self.folder = Path(tempfile.mkdtemp(prefix="ridetune-postgresql-"))
        if self._user:
            shutil.chown(self.folder, **self._user)
        data = str(self.folder / "data")
        options = ["--username=ridetune", "--auth=trust", "--encoding=UTF8", "--locale=C"]
        self._run("initdb", "-D", data, "--no-sync", *options)
        self._control = ("pg_ctl", "-D", data, "-w")
        self.start()

    def start(self) -> None:
        """Start, and wait until it answers."""
        options = f"-k {self.folder} -h '' -c fsync=off -c full_page_writes=off"
        self._run(*self._control, "-o", options, "-l", str(self.folder / "log"), "start")

    def stop(self) -> None:
        """Break all connections off and end."""
        self._run(*self._control, "-m", "fast", "stop")

    def close(self) -> None:
        """End, and leave nothing."""
        self._run(*self._control, "-m", "immediate", "stop")
        shutil.rmtree(self.folder)

    @contextmanager
    def database(self) -> Iterator[str]:
        """The URL of a database that is there for a while."""
        name = f"test_{secrets.token_hex(4)}"
        self.execute(f"CREATE DATABASE {name}")
        yield self.url(name)
        self.execute(f"DROP DATABASE {name} WITH (FORCE)")

    def url(self, name: str) -> str:
        """Of a database by its name."""
        return f"postgresql://ridetune@/{name}?host={self.folder}"

    def execute(self, statement: str) -> None:
        """As the superuser, outside the tests' databases."""
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(statement)

    def _run(self, program: str, *arguments: str) -> None:
        command = [str(self._bin / program), *arguments]
        done = subprocess.run(
            command,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            **self._user,
        )
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresqlServer]:
    """A server for the tests that need one."""
    server = PostgresqlServer()
    yield server
    server.close()


@pytest.fixture
def on_postgresql(postgresql) -> Iterator[str]:
    """The URL of an empty database."""
    with postgresql.database() as url:
        yield url


def _binaries() -> Path:
    """Debian keeps them out of PATH, by version."""
    found = shutil.which("initdb") or max(
        glob.glob("/usr/lib/postgresql/*/bin/initdb"),
        key=lambda path: int(path.split("/")[4]),
        default=None,
    )
    if found is None:
        raise FileNotFoundError(MISSING)
    return Path(found).parent
