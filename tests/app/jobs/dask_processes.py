"""A Dask scheduler and workers as processes of their own behind TLS, set up as docs/deploy says."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from ridetune.app.settings import Certificates

DEPLOY = Path(__file__).parents[3] / "docs" / "deploy"
PATIENCE = 90.0


@dataclass
class DaskProcesses:
    """`address` and `certificates` are what a service is told."""

    folder: Path
    certificates: Certificates
    scheduler: subprocess.Popen = field(init=False)
    workers: list[subprocess.Popen] = field(default_factory=list)

    @property
    def address(self) -> str:
        return (self.folder / "address").read_text().strip()

    def start_scheduler(self, port: int = 0) -> None:
        """Start it, and wait until it listens; it was killed if there was one."""
        log = self.folder / "scheduler.log"
        log.unlink(missing_ok=True)
        where = ("--host", "tls://127.0.0.1", "--port", str(port))
        self.scheduler = self._start("scheduler", log, *where, "--protocol", "tls")
        deadline = time.monotonic() + PATIENCE
        while "Scheduler at:" not in (text := log.read_text()):
            assert self.scheduler.poll() is None, text
            assert time.monotonic() < deadline, text
            time.sleep(0.05)
        address = next(word for word in text.split() if word.startswith("tls://"))
        (self.folder / "address").write_text(address)

    def start_worker(self) -> subprocess.Popen:
        """Start another one: a nanny and its worker of one thread."""
        log = self.folder / f"worker-{len(self.workers)}.log"
        scratch = ("--local-directory", str(self.folder))
        size = ("--nworkers", "1", "--nthreads", "1", "--host", "127.0.0.1")
        self.workers.append(self._start("worker", log, self.address, *size, *scratch))
        return self.workers[-1]

    def _start(self, what: str, log: Path, *arguments: str) -> subprocess.Popen:
        files = self.certificates
        command = [sys.executable, "-m", "dask", what, *arguments, "--no-dashboard"]
        command += ["--dashboard-address", "127.0.0.1:0", "--tls-ca-file", str(files.ca)]
        command += ["--tls-cert", str(files.certificate), "--tls-key", str(files.key)]
        environment = os.environ | {"DASK_CONFIG": str(DEPLOY / "dask.yaml")}
        with log.open("wb") as output:
            return subprocess.Popen(
                command, env=environment, stdout=output, stderr=output, start_new_session=True
            )

    def close(self) -> None:
        """End all of them, the workers with their nannies."""
        for process in (*self.workers, self.scheduler):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait(PATIENCE)


@pytest.fixture(scope="session")
def dask_processes(tmp_path_factory) -> Iterator[DaskProcesses]:
    """A scheduler and two workers that tests share; one that kills some starts others."""
    folder = tmp_path_factory.mktemp("dask-processes")
    processes = DaskProcesses(folder, make_certificates(folder))
    processes.start_scheduler()
    try:
        for _ in range(2):
            processes.start_worker()
        yield processes
    finally:
        processes.close()


def make_certificates(folder: Path) -> Certificates:
    """An authority, and a certificate of it for 127.0.0.1."""
    authority_key, key = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    authority = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "authority")])
    now = datetime.now(UTC)

    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key())

    def signed(name: x509.Name, public, *extensions: x509.ExtensionType) -> bytes:
        builder = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(authority)
            .public_key(public)
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(minutes=5))
            .not_valid_after(now + timedelta(days=1))
        )
        for extension in extensions:
            builder = builder.add_extension(extension, critical=True)
        for identifier in (x509.SubjectKeyIdentifier.from_public_key(public), issuer):
            builder = builder.add_extension(identifier, critical=False)
        return builder.sign(authority_key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)

    own = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "cluster")])
    here = x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))])
    top = x509.BasicConstraints(ca=True, path_length=None)
    files = Certificates(folder / "authority.pem", folder / "cluster.pem", folder / "cluster.key")
    files.ca.write_bytes(signed(authority, authority_key.public_key(), top))
    files.certificate.write_bytes(signed(own, key.public_key(), here))
    files.key.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return files
