"""What the service is told from outside: where its data lives, where it listens, how much it takes.

Every setting has an environment variable, and what is named like one but is none is refused.
"""

import math
import os
import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import TypeVar
from urllib.parse import quote, urlsplit

from . import logs
from .addresses import Network, in_brackets, is_loopback, networks, origin, without_port
from .errors import StartError
from .limits import LIMITS, Limits

OURS = "RIDETUNE_"
NAMES = (
    "HOST",
    "PORT",
    "DATA",
    "LOGIN",
    "TOKEN",
    "PUBLIC_URL",
    "PROXY_USER_HEADER",
    "PROXY_ADDRESSES",
    "ALLOWED_HOSTS",
    "CLUSTER",
    "CLUSTER_CA",
    "CLUSTER_CERT",
    "CLUSTER_KEY",
    "DATABASE",
    "CACHE",  # read by the engine
    "GRACE",
    "NOTICE",
    "LOG",
    "LOG_LEVEL",
)
VARIABLES = (*(OURS + name for name in NAMES), *LIMITS)
"""All there are."""

EVERY_ADDRESS = ("0.0.0.0", "::")
"""To listen there; nobody's name for the service."""
TOKEN_LENGTH = 16
"""The least, which nobody guesses if it is random."""
MAKES_TOKEN = 'python3 -c "import secrets; print(secrets.token_hex(24))"'

Choice = TypeVar("Choice", bound=str)


@dataclass(frozen=True)
class Certificates:
    """PEM files by which both ends of a connection to a scheduler know each other.

    ca : the authority's certificate;  certificate, key : this end's own
    """

    ca: Path
    certificate: Path
    key: Path


@dataclass(frozen=True, kw_only=True)
class Settings:
    """One service.

    login : whether visitors must be let in; without it everybody on this machine is
    token : lets in whoever brings it, as often as they like; empty for none
    public_url : scheme, host and port of the proxy that visitors see; empty for none
    proxy_user_header, proxy_addresses : where the proxy names the user, and who may say so
    cluster : empty for workers of its own, else a Dask scheduler's address
    certificates : what a scheduler at tls:// asks for
    database : empty for SQLite in the data directory, else a PostgreSQL URL
    grace : how long requests under way may take when the service is told to end, s
    notice : how long it says that it ends before it does, s
    log, log_level : the form of log records, and which of our own are written
    """

    data: Path
    host: str = "127.0.0.1"
    port: int = 8000
    login: bool = True
    token: str = field(default="", repr=False)
    public_url: str = ""
    proxy_user_header: str = ""
    proxy_addresses: tuple[Network, ...] = ()
    allowed_hosts: tuple[str, ...] = ()
    cluster: str = ""
    certificates: Certificates | None = None
    database: str = field(default="", repr=False)
    grace: float = 10.0
    notice: float = 0.0
    log: logs.Form = "text"
    log_level: str = "WARNING"
    limits: Limits = field(default_factory=Limits)

    @classmethod
    def from_environment(
        cls,
        *,
        host: str | None = None,
        port: int | None = None,
        data: str | Path | None = None,
        login: bool | None = None,
        environment: Mapping[str, str] = os.environ,
    ) -> "Settings":
        """Settings from the environment; an argument that is not None goes before it."""
        _check_names(environment)
        allowed = environment.get("RIDETUNE_ALLOWED_HOSTS", "")
        cluster = environment.get("RIDETUNE_CLUSTER", "")
        return cls(
            data=Path(data or environment.get("RIDETUNE_DATA") or usual_data(environment)),
            host=host or environment.get("RIDETUNE_HOST") or cls.host,
            port=_port(environment.get("RIDETUNE_PORT", cls.port) if port is None else port),
            login=_login(environment.get("RIDETUNE_LOGIN", "on")) if login is None else login,
            token=_token(environment.get("RIDETUNE_TOKEN", "")),
            public_url=origin(environment.get("RIDETUNE_PUBLIC_URL", "")),
            proxy_user_header=environment.get("RIDETUNE_PROXY_USER_HEADER", "").strip(),
            proxy_addresses=networks(environment.get("RIDETUNE_PROXY_ADDRESSES", "")),
            allowed_hosts=_host_names(allowed),
            cluster=cluster,
            certificates=_certificates(cluster, environment),
            database=environment.get("RIDETUNE_DATABASE", ""),
            grace=_seconds("RIDETUNE_GRACE", environment, cls.grace),
            notice=_seconds("RIDETUNE_NOTICE", environment, cls.notice),
            log=_one_of(logs.FORMS, logs.FORM, environment, cls.log),
            log_level=_one_of(logs.LEVELS, logs.LEVEL, environment, cls.log_level),
            limits=Limits.from_environment(environment),
        )

    def check_bind(self, *, keys: bool = False) -> None:
        """Refuse ways in that contradict each other or open the service to other machines; `keys`
        tells whether there are any.
        """
        if not self.login and (self.token or self.proxy_user_header or self.public_url):
            raise StartError(
                "Without login whoever reaches the service is let in, which goes neither with "
                "RIDETUNE_TOKEN and RIDETUNE_PROXY_USER_HEADER nor with RIDETUNE_PUBLIC_URL; leave "
                "those out, or the login on."
            )
        if bool(self.proxy_user_header) != bool(self.proxy_addresses):
            raise StartError(
                "RIDETUNE_PROXY_USER_HEADER, the header in which a proxy names the user, and "
                "RIDETUNE_PROXY_ADDRESSES, from where it is believed, need each other; set both."
            )
        if is_loopback(self.host):
            return
        if not self.login:
            raise StartError(
                f"Listening on {self.host} without login would open the service to other machines; "
                "leave the login on, or use --host 127.0.0.1."
            )
        if not (self.token or self.proxy_user_header or keys):
            raise StartError(
                f"Listening on {self.host} would open the service to other machines; set "
                "RIDETUNE_TOKEN to a secret that visitors must bring, make a key with "
                f"`{shlex.join(['ridetune', 'keys', 'add', 'NAME', '--data', str(self.data)])}`, "
                "set up the login of a proxy, or use --host 127.0.0.1."
            )

    @property
    def https(self) -> bool:
        """Whether visitors come by https, through a proxy."""
        return self.public_url.startswith("https:")

    def host_names(self) -> frozenset[str]:
        """Names a request's Host header may carry, lower case and without port."""
        own = () if self.host in EVERY_ADDRESS else (in_brackets(self.host),)
        public = (without_port(urlsplit(self.public_url).netloc),) if self.public_url else ()
        names = ("localhost", "127.0.0.1", "[::1]", *own, *public, *self.allowed_hosts)
        return frozenset(name.lower() for name in names)


def _check_names(environment: Mapping[str, str]) -> None:
    """Refuse what is misspelt, which would leave a default in its place."""
    for variable in sorted(name for name in environment if name.startswith(OURS)):
        if variable not in VARIABLES:
            names = [*NAMES, *(limit.removeprefix(OURS) for limit in LIMITS)]
            near = get_close_matches(variable.removeprefix(OURS), names, n=1)
            known = f"known are {', '.join(OURS + name for name in NAMES)}, and one for each limit."
            hint = f"did you mean {OURS}{near[0]}?" if near else known
            raise StartError(f"There is no setting {variable}; {hint}")


def _host_names(text: str) -> tuple[str, ...]:
    """What RIDETUNE_ALLOWED_HOSTS lists, as a Host header has it."""
    stated = tuple(in_brackets(name.strip()) for name in text.split(",") if name.strip())
    for name in stated:
        if "/" in name or "*" in name or without_port(name) != name:
            raise StartError(
                f"RIDETUNE_ALLOWED_HOSTS has {name!r}; list names only, such as ride.example.com, "
                "without scheme, port or *."
            )
    return stated


def _token(text: str) -> str:
    """A secret that nobody guesses, and that comes unchanged out of an address, where + is a
    space.
    """
    if text and quote(text, safe="") != text:
        raise StartError(
            "RIDETUNE_TOKEN has characters that an address changes; make one of letters and "
            f"digits, as `{MAKES_TOKEN}` does."
        )
    if 0 < len(text) < TOKEN_LENGTH:
        raise StartError(
            f"RIDETUNE_TOKEN has fewer than {TOKEN_LENGTH} characters and could be guessed; make "
            f"one with `{MAKES_TOKEN}`."
        )
    return text


def _login(text: str) -> bool:
    if text not in ("on", "off"):
        raise StartError(f"RIDETUNE_LOGIN is {text!r}; it is on, or off for everybody.")
    return text == "on"


def usual_data(environment: Mapping[str, str]) -> Path:
    """Where everything is kept unless told otherwise."""
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


def _certificates(cluster: str, environment: Mapping[str, str]) -> Certificates | None:
    """The three files, which go with a scheduler at tls:// and with no other."""
    variables = [f"RIDETUNE_CLUSTER_{part}" for part in ("CA", "CERT", "KEY")]
    stated = [environment.get(variable, "") for variable in variables]
    encrypted = cluster.startswith("tls://")
    for variable, path in zip(variables, stated, strict=True):
        if encrypted and not os.access(path, os.R_OK):
            what = f"{path} cannot be read" if path else "is not set"
            raise StartError(
                f"{variable} {what}; {cluster} needs a readable PEM file in each of "
                f"{', '.join(variables)}."
            )
        if path and not encrypted:
            raise StartError(f"{variable} is of use only with a RIDETUNE_CLUSTER at tls://.")
    return Certificates(*map(Path, stated)) if encrypted else None


def _one_of(
    known: tuple[Choice, ...], variable: str, environment: Mapping[str, str], default: Choice
) -> Choice:
    stated = environment.get(variable) or default
    for choice in known:
        if choice == stated:
            return choice
    raise StartError(f"{variable} is {stated!r}; give one of {', '.join(known)}.")


def _seconds(variable: str, environment: Mapping[str, str], default: float) -> float:
    text = environment.get(variable, "")
    with suppress(ValueError):
        if 0 <= (seconds := float(text or default)) < math.inf:
            return seconds
    raise StartError(f"{variable} is {text!r}; give a number of seconds, 0 or more.")
