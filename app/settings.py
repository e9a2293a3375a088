"""What the service is told from outside: where its data lives, where it listens, how much it takes.

Every setting has an environment variable: RIDETUNE_DATA, RIDETUNE_HOST, RIDETUNE_PORT,
RIDETUNE_TOKEN, RIDETUNE_ALLOWED_HOSTS (comma separated), RIDETUNE_CLUSTER, RIDETUNE_DATABASE, and
for each limit RIDETUNE_LIMIT_ followed by its name in capitals.
"""

import dataclasses
import ipaddress
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from .errors import StartError

LIMIT = "RIDETUNE_LIMIT_"


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What one request, one session or the whole service may ask for."""

    upload_bytes: int = 100_000_000
    body_bytes: int = 4_000_000
    reader_bytes: int = 2 << 30
    reader_seconds: int = 20
    sessions: int = 1000
    session_measurements: int = 50
    session_bytes: int = 500_000_000
    session_jobs: int = 200
    unfinished_jobs: int = 4
    session_simulations: int = 4
    waiting_simulations: int = 64
    readers: int = 2
    session_readings: int = 16
    waiting_readings: int = 64
    simulated_seconds: float = 600.0
    simulated_steps: int = 400_000
    banded_steps: int = 2_000_000
    identified_samples: int = 400_000
    advised_seconds: float = 1000.0
    swept_cars: int = 100_000
    swept_steps: int = 2_000_000_000
    driven_seconds: float = 600.0
    long_driven_seconds: float = 200.0
    unwatched_seconds: float = 600.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """One service.

    cluster : empty for workers of its own, else a Dask scheduler's address
    database : empty for SQLite in the data directory, else a PostgreSQL URL
    """

    data: Path
    host: str = "127.0.0.1"
    port: int = 8000
    token: str = ""
    allowed_hosts: tuple[str, ...] = ()
    cluster: str = ""
    database: str = field(default="", repr=False)
    limits: Limits = field(default_factory=Limits)

    @classmethod
    def from_environment(
        cls,
        *,
        host: str | None = None,
        port: int | None = None,
        data: str | Path | None = None,
        environment: Mapping[str, str] = os.environ,
    ) -> "Settings":
        """Settings from the environment; an argument that is not None goes before it."""
        allowed = environment.get("RIDETUNE_ALLOWED_HOSTS", "")
        return cls(
            data=Path(data or environment.get("RIDETUNE_DATA") or _default_data(environment)),
            host=host or environment.get("RIDETUNE_HOST") or cls.host,
            port=_port(environment.get("RIDETUNE_PORT", cls.port) if port is None else port),
            token=environment.get("RIDETUNE_TOKEN", ""),
            allowed_hosts=tuple(name.strip() for name in allowed.split(",") if name.strip()),
            cluster=environment.get("RIDETUNE_CLUSTER", ""),
            database=environment.get("RIDETUNE_DATABASE", ""),
            limits=_limits(environment),
        )

    def check_bind(self) -> None:
        """Refuse to be reachable from other machines without a token."""
        if not self.token and not is_loopback(self.host):
            raise StartError(
                f"Listening on {self.host} would open the service to other machines; set "
                "RIDETUNE_TOKEN to a secret that visitors must bring, or use --host 127.0.0.1."
            )

    def host_names(self) -> frozenset[str]:
        """Names a request's Host header may carry, lower case and without port."""
        own = () if self.host in ("0.0.0.0", "::") else (self.host,)
        names = ("localhost", "127.0.0.1", "[::1]", *own, *self.allowed_hosts)
        return frozenset(name.lower() for name in names)


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches the address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _default_data(environment: Mapping[str, str]) -> Path:
    shared = environment.get("XDG_DATA_HOME") or os.path.expanduser("~/.local/share")
    return Path(shared) / "ridetune"


def _port(value: int | str) -> int:
    try:
        port = int(value)
    except ValueError:
        port = -1
    if not 0 <= port <= 65535:
        raise StartError(f"The port {value!r} is not a number from 0 to 65535; give another one.")
    return port


def _limits(environment: Mapping[str, str]) -> Limits:
    known = {f"{LIMIT}{limit.name.upper()}": limit for limit in dataclasses.fields(Limits)}
    stated = {}
    for variable in sorted(name for name in environment if name.startswith(LIMIT)):
        if variable not in known:
            near = get_close_matches(variable, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
            raise StartError(f"There is no limit {variable}; {hint}")
        limit, text = known[variable], environment[variable]
        stated[limit.name] = _positive(variable, text, type(limit.default))
    return Limits(**stated)


def _positive(variable: str, text: str, kind: Any) -> int | float:
    """A finite number above 0 of the limit's kind."""
    with suppress(ValueError):
        if 0 < (number := kind(text)) < math.inf:
            return number
    what = "whole number" if kind is int else "number"
    raise StartError(f"{variable} is {text!r}; give a {what} above 0.")
