"""What docs/deploy holds fits the program: settings, options and paths, and what Dask is told."""

import re
import ssl
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml
from distributed.cli import dask_scheduler, dask_worker
from ridetune.app.access.origins import refusal
from ridetune.app.jobs.dask_connection import CONFIGURATION
from ridetune.app.settings import VARIABLES, Settings

ROOT = Path(__file__).parents[1]
DEPLOY = ROOT / "docs" / "deploy"
FILES = sorted(DEPLOY.iterdir())
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
DOCKERFILE = (DEPLOY / "Dockerfile").read_text()
READ_ELSEWHERE = {"RIDETUNE_CACHE"}
"""By the engine."""


class Asked(dict):
    """An environment that notes what it is asked for."""

    def __init__(self):
        self.names = set(READ_ELSEWHERE)

    def get(self, name, default=None):
        self.names.add(name)
        return default

    def __contains__(self, name):
        self.names.add(name)
        return False


def copied() -> list[str]:
    """What the image is made of, as paths in the checkout."""
    lines = re.findall(r"^COPY (?!--from)(.*)$", DOCKERFILE, re.MULTILINE)
    return [source for line in lines for source in line.split()[:-1]]


def test_every_variable_is_read():
    """Those that the service knows by name, so that it refuses all others."""
    environment = Asked()
    Settings.from_environment(environment=environment)
    assert {name for name in environment.names if name.startswith("RIDETUNE_")} == set(VARIABLES)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_variable_is_a_setting(file):
    assert set(re.findall(r"RIDETUNE_[A-Z_]+", file.read_text())) <= set(VARIABLES)


@pytest.mark.parametrize("file", ["Caddyfile", "nginx.conf", "compose.yaml"])
def test_the_page_may_change_something_through_the_proxy(file):
    """Its origin is https and the service's own scheme is http, so the service has to be told."""
    told = dict(re.findall(r"(RIDETUNE_[A-Z_]+)=(\S+)", (DEPLOY / file).read_text()))
    if file == "compose.yaml":
        told = {"RIDETUNE_PUBLIC_URL": "https://ride.example"}
        assert told.keys() <= COMPOSE["services"]["ridetune"]["environment"].keys()
    settings = Settings.from_environment(environment=told)
    sent = {"host": "ride.example", "origin": "https://ride.example"}
    headers = [(name.encode(), value.encode()) for name, value in sent.items()]
    scope = {"type": "http", "method": "POST", "headers": headers}
    assert refusal(scope, settings.host_names(), settings.public_url) is None


def test_what_the_image_is_made_of_is_there_and_sent():
    allowed = {
        line[1:]
        for line in (DEPLOY / "Dockerfile.dockerignore").read_text().splitlines()
        if line.startswith("!")
    }
    for source in copied():
        assert (ROOT / source).exists(), source
        assert any(fnmatch(source, name) or source.startswith(f"{name}/") for name in allowed)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_what_runs_in_the_image_was_copied_there(file):
    there = {Path(source).name for source in copied()}
    assert set(re.findall(r"/opt/ridetune/deploy/([\w.-]+)", file.read_text())) <= there


def test_compose_names_only_what_it_declares():
    services = COMPOSE["services"]
    for name, service in services.items():
        mounted = {volume.split(":")[0] for volume in service.get("volumes", [])}
        assert mounted <= COMPOSE["volumes"].keys(), name
        assert set(service.get("networks", [])) <= COMPOSE["networks"].keys(), name
        assert service.get("depends_on", {}).keys() <= services.keys(), name


def test_every_part_is_hardened_and_watched():
    """What is not healthy of itself is watched by another, or ends by itself."""
    for name, service in COMPOSE["services"].items():
        assert "no-new-privileges:true" in service["security_opt"], name
        if service["image"] == "ridetune":
            assert service["read_only"], name
            assert service["cap_drop"] == ["ALL"], name
    checked = {name for name, told in COMPOSE["services"].items() if "healthcheck" in told}
    assert COMPOSE["services"].keys() - checked == {"ridetune"}
    assert re.search(r"^HEALTHCHECK .*\\\n.*/healthz", DOCKERFILE, re.MULTILINE)


@pytest.mark.parametrize(
    ("part", "program"), [("scheduler", dask_scheduler.main), ("worker", dask_worker.main)]
)
def test_dask_takes_what_it_is_told(part, program):
    command = COMPOSE["services"][part]["command"]
    assert command[:2] == ["dask", part]
    known = {name for option in program.params for name in (*option.opts, *option.secondary_opts)}
    told = {word.split("=")[0] for word in command if word.startswith("--")}
    assert told <= known


def test_dask_elsewhere_is_set_up_as_ours():
    told = yaml.safe_load((DEPLOY / "dask.yaml").read_text())

    def at(name: str):
        found = told
        for key in name.split("."):
            found = found[key]
        return found

    assert {name: at(name) for name in CONFIGURATION} == CONFIGURATION
    assert at("distributed.comm.require-encryption") is True


def test_certificates_are_made_once_and_hold(tmp_path):
    """Both ends take each other's by the strict rules that newer Pythons go by."""
    command = [str(DEPLOY / "make-certificates"), str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    assert {path.name for path in tmp_path.iterdir()} == {
        "authority.pem",
        "cluster.pem",
        "cluster.key",
    }
    assert (tmp_path / "cluster.key").stat().st_mode & 0o077 == 0
    shake_hands(tmp_path)
    key = (tmp_path / "cluster.key").read_bytes()
    subprocess.run(command, check=True, capture_output=True)
    assert (tmp_path / "cluster.key").read_bytes() == key


def test_certificates_are_renewed_as_the_documents_say(tmp_path):
    """The command that removes the former ones, in another folder; then all are new and hold."""
    text = (ROOT / "docs/operations.md").read_text()
    [remove] = re.findall(r"docker compose run --rm certificates sh -c '(rm .*)'", text)
    names = re.findall(r"certificates \w+ (?:\w+ )*ridetune$", text, re.MULTILINE)[0].split()
    mounting = [name for name, one in COMPOSE["services"].items() if "certificates" in str(one)]
    assert set(mounting) == set(names)
    make = [str(DEPLOY / "make-certificates"), str(tmp_path)]
    subprocess.run(make, check=True, capture_output=True)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    there = remove.replace("/var/lib/ridetune-certificates", str(tmp_path))
    subprocess.run(["sh", "-c", there], check=True)
    assert list(tmp_path.iterdir()) == []
    subprocess.run(make, check=True, capture_output=True)
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert after.keys() == before.keys()
    assert not [name for name in after if after[name] == before[name]]
    shake_hands(tmp_path)


def shake_hands(folder: Path) -> None:
    def end(purpose: ssl.Purpose) -> ssl.SSLContext:
        context = ssl.create_default_context(purpose, cafile=str(folder / "authority.pem"))
        context.load_cert_chain(folder / "cluster.pem", folder / "cluster.key")
        context.check_hostname = False
        context.verify_mode = ssl.CERT_REQUIRED
        context.verify_flags |= ssl.VERIFY_X509_STRICT
        return context

    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = end(ssl.Purpose.SERVER_AUTH).wrap_bio(down, up)
    server = end(ssl.Purpose.CLIENT_AUTH).wrap_bio(up, down, server_side=True)
    for one in (client, server, client, server):
        try:
            one.do_handshake()
        except ssl.SSLWantReadError:
            continue
    assert client.version() == server.version() == "TLSv1.3"


def test_a_container_starts_with_its_kernels_where_they_may_be_written(tmp_path):
    kernels, cache = tmp_path / "kernels", tmp_path / "cache"
    (kernels / "of-a-hash").mkdir(parents=True)
    (kernels / "of-a-hash" / "one.nbi").write_bytes(b"compiled")
    cache.mkdir()
    environment = {"PATH": "/usr/bin:/bin", "KERNELS": str(kernels), "RIDETUNE_CACHE": str(cache)}
    started = subprocess.run(
        [str(DEPLOY / "start"), "sh", "-c", 'cat "$RIDETUNE_CACHE/of-a-hash/one.nbi"'],
        env=environment,
        capture_output=True,
        check=True,
    )
    assert started.stdout == b"compiled"
