"""Test server: the real service in a separate process on a loopback port."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from app.access.service import AccessService
from app.database import Database
from app.settings import load_settings
from motorid.client import Client
from tests.motors import simulated

ENDED = {"succeeded", "failed", "cancelled"}
API = "/api/v1"
PRETENDED = "tests.app.pretended:identify"
_COMMAND = "import sys; from app.cli import main; sys.exit(main())"
MOTOR = np.array([2.0, 0.004, 0.05, -0.001, 2e-5, 2e-5, 2e-3])
"""Values in the order of `tests.motors.NAMES`; a fit of another motor's signals takes longer."""
HEADER = "time_s,voltage_V,current_A,speed_rad_s,temperature_degC"


def run_text(seed: int, rows: int = 60) -> bytes:
    """Run file of `MOTOR`, different for each seed."""
    noise = np.random.default_rng(seed)
    step = np.arange(rows)
    voltage = np.where(step // 10 % 2 == 0, 12.0, -12.0) + noise.normal(0.0, 0.05, rows)
    temperature = 25.0 + step / rows
    followed = simulated(MOTOR, 1e-3, voltage, temperature, np.zeros(2))
    current, speed = (followed + noise.normal(0.0, (0.01, 0.1), (rows, 2))).T
    temperature += noise.normal(0.0, 0.01, rows)
    cells = np.column_stack([step * 1e-3, voltage, current, speed, temperature])
    lines = [",".join(f"{cell:.6f}" for cell in row) for row in cells]
    return "\n".join([HEADER, *lines, ""]).encode()


class Server:
    """Server process.

    `command` is the Python code that stands for ``motorid``.

    Args:
        data_dir: Data directory of the server.
        arguments: Arguments of ``motorid serve``.
        settings: Further MOTORID_ variables, without the prefix.
    """

    command = _COMMAND

    def __init__(self, data_dir: Path, *arguments: str, **settings: object) -> None:
        self.data_dir = data_dir
        self.log: list[str] = []
        variables = {"PIPELINE": PRETENDED, "WORKERS": 2, "READERS": 2} | settings
        environment = os.environ | {f"MOTORID_{n}": str(value) for n, value in variables.items()}
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-c", self.command, "serve", "--port", "0"),
                *("--data-dir", str(data_dir), *arguments),
            ],
            env=environment,
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read_log, daemon=True)
        self._reader.start()
        self.url = self._await_address()

    def kill(self) -> None:
        """Kill the server with SIGKILL."""
        self.process.kill()
        self._wait()

    def stop(self) -> int:
        """Stop the server with SIGTERM and return its exit status."""
        self.process.terminate()
        return self._wait()

    def _wait(self) -> int:
        status = self.process.wait(timeout=30)
        self._reader.join()
        if self.process.stderr:
            self.process.stderr.close()
        return status

    def _read_log(self) -> None:
        assert self.process.stderr
        self.log.extend(iter(self.process.stderr.readline, ""))

    def _await_address(self) -> str:
        # A busy machine may need minutes to load the modules of a server.
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline and self.process.poll() is None:
            for line in list(self.log):
                found = re.search(r"http://[^\s\"]+:\d+", line)
                if found and self._answers(found.group()):
                    return found.group()
            time.sleep(0.02)
        self.kill()
        raise AssertionError("the server does not start:\n" + "".join(self.log))

    def _answers(self, url: str) -> bool:
        try:
            return httpx.get(f"{url}/readyz").status_code == 200
        except httpx.TransportError:
            return False


class Caller:
    """Client of a server.

    Args:
        server: The server.
        key: Key of the client, or None.
    """

    def __init__(self, server: Server, key: str | None = None) -> None:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self.client = Client(server.url, key)
        self.http = httpx.Client(base_url=server.url + API, headers=headers, timeout=30)

    def close(self) -> None:
        """Close the connections."""
        self.http.close()
        self.client.close()

    def __enter__(self) -> Caller:
        """Return the client."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connections."""
        self.close()

    def upload(self, content: bytes, name: str = "run.csv", **fields: str) -> dict[str, Any]:
        """Store a run."""
        stored = self.client.upload(content, name=name, **fields)
        return dict(stored.content)

    def begin(self, *training: str, seed: int = 0, **options: object) -> dict[str, Any]:
        """Submit a fit."""
        return dict(self.client.fit(training, options={"seed": seed, **options}).content)

    def fit(self, fit_id: str) -> dict[str, Any]:
        """Current state of a fit."""
        return dict(self.client.show_fit(fit_id).content)

    def wait(self, fit_id: str, *states: str, seconds: float = 30) -> dict[str, Any]:
        """Wait until a fit is in one of the given states, or has ended; return the fit."""
        deadline = time.monotonic() + seconds
        while (fit := self.fit(fit_id))["status"] not in (states or ENDED):
            assert fit["status"] not in ENDED, fit
            assert time.monotonic() < deadline, fit
            time.sleep(0.05)
        return fit


def empty(server: Server) -> None:
    """Remove the new files, runs and fits of a service without keys."""
    with Caller(server) as caller:
        httpx.delete(f"{server.url}/pending", headers={"HX-Request": "true"}).raise_for_status()
        for fit in list(caller.client.fits()):
            caller.client.delete_fit(fit)
        for run in list(caller.client.runs()):
            caller.client.delete_run(run)


def make_key(data_dir: Path, workspace: str = "default") -> str:
    """Create a key in a data directory, as `motorid keys create` does."""
    data_dir.mkdir(parents=True, exist_ok=True)
    # Use the database of the server, which MOTORID_DATABASE_URL may select.
    database = Database(load_settings(data_dir=data_dir).sqlalchemy_url)
    database.migrate()
    _, secret = AccessService(database).create_key("test", workspace)
    database.close()
    return secret


@contextmanager
def serving(data_dir: Path, *arguments: str, **settings: object) -> Iterator[Server]:
    """Run a server while the block runs."""
    server = Server(data_dir, *arguments, **settings)
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.stop()
