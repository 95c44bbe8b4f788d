"""Temporary Dask cluster: a scheduler and workers on loopback.

with Cluster.running(directory, workers=2) as cluster:
    settings = load_settings(engine="dask", dask_scheduler=cluster.address)
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

__all__ = ["OPENSSL", "Certificates", "Cluster", "free_port"]

OPENSSL = shutil.which("openssl")
_QUIET = ("--no-dashboard",)


@dataclass(frozen=True)
class Certificates:
    """Certificate authority and a certificate signed by it.

    Args:
        directory: Directory of the files.
    """

    directory: Path

    @classmethod
    def made(cls, directory: Path) -> Self:
        """Create the files."""
        directory.mkdir(parents=True)
        made = cls(directory)
        ca, key = str(made.ca), str(made.ca_key)
        new = ("req", "-nodes", "-newkey", "rsa:2048", "-subj")
        _openssl(*new, "/CN=authority", "-x509", "-days", "2", "-keyout", key, "-out", ca)
        request = str(directory / "request.pem")
        _openssl(*new, "/CN=motorid", "-keyout", str(made.key), "-out", request)
        signed = ("-CA", ca, "-CAkey", key, "-CAcreateserial", "-days", "2")
        _openssl("x509", "-req", "-in", request, *signed, "-out", str(made.certificate))
        return made

    @property
    def ca(self) -> Path:
        """Certificate of the authority."""
        return self.directory / "ca.pem"

    @property
    def ca_key(self) -> Path:
        """Private key of the authority."""
        return self.directory / "ca-key.pem"

    @property
    def certificate(self) -> Path:
        """Certificate shared by the scheduler, the workers and the client."""
        return self.directory / "cert.pem"

    @property
    def key(self) -> Path:
        """Private key of the certificate."""
        return self.directory / "key.pem"

    def words(self) -> tuple[str, ...]:
        """TLS options of the Dask programs."""
        return (
            *("--tls-ca-file", str(self.ca), "--tls-cert", str(self.certificate)),
            *("--tls-key", str(self.key)),
        )


class Cluster:
    """Scheduler and workers, each in a separate process group.

    Args:
        directory: Directory for temporary files and logs of the workers.
        certificates: Certificates for TLS; None for plain TCP.
    """

    def __init__(self, directory: Path, certificates: Certificates | None = None) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self._directory = directory
        self._certificates = certificates
        self._words = certificates.words() if certificates else ()
        self._port = free_port()
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []

    @classmethod
    @contextmanager
    def running(
        cls, directory: Path, *, workers: int = 1, certificates: Certificates | None = None
    ) -> Iterator[Self]:
        """Run a cluster while the block runs."""
        cluster = cls(directory, certificates)
        cluster.start_scheduler()
        for _ in range(workers):
            cluster.start_worker()
        try:
            yield cluster
        finally:
            cluster.stop()

    @property
    def address(self) -> str:
        """Address of the scheduler."""
        return f"{'tls' if self._certificates else 'tcp'}://127.0.0.1:{self._port}"

    def start_scheduler(self) -> None:
        """Start the scheduler, always at the same address."""
        protocol = "tls" if self._certificates else "tcp"
        self.scheduler = self._start(
            "scheduler", "--protocol", protocol, "--host", "127.0.0.1", "--port", str(self._port)
        )

    def start_worker(self) -> None:
        """Start another worker with two threads."""
        words = ("--nthreads", "2", "--memory-limit", "0", "--host", "127.0.0.1", "--no-nanny")
        local = ("--local-directory", str(self._directory), "--death-timeout", "60")
        self.workers.append(self._start("worker", self.address, *words, *local))

    def kill_scheduler(self) -> None:
        """Kill the scheduler with SIGKILL."""
        assert self.scheduler
        self.scheduler.kill()
        self.scheduler.wait()

    def kill_worker(self, number: int = 0) -> None:
        """Kill a worker with SIGKILL."""
        worker = self.workers.pop(number)
        worker.kill()
        worker.wait()

    def tend(self) -> None:
        """Restart processes that have ended, as the restart policy of a container does.

        A worker ends by itself after it has lost its scheduler.
        """
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.start_scheduler()
        for worker in [w for w in self.workers if w.poll() is not None]:
            self.workers.remove(worker)
            self.start_worker()

    def stop(self) -> None:
        """Kill all processes."""
        for process in (*self.workers, *filter(None, [self.scheduler])):
            process.send_signal(signal.SIGKILL)
            process.wait()

    def _start(self, program: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{program}", *words]
        with (self._directory / f"{program}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, *self._words, *_QUIET],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
                start_new_session=True,
            )


def free_port() -> int:
    """Port on which no process listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _openssl(*words: str) -> None:
    assert OPENSSL
    command: Sequence[str] = (OPENSSL, *words)
    subprocess.run(command, check=True, capture_output=True)
