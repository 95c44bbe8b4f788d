"""Service with two fits of one motor."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from identification.ingest import write_run
from motorid.client import Client
from tests.app.service import Server, serving
from tests.motors import campaign, motor_named

MOTOR = "servo <1>"


@dataclass(frozen=True)
class Bench:
    """Service with two fits of one motor.

    Args:
        server: The service.
        http: Client of the service.
        first: ID of the fit of the first run.
        second: ID of the fit of both runs.
        runs: IDs of the runs.
        files: Their files.
    """

    server: Server
    http: httpx.Client
    first: str
    second: str
    runs: tuple[str, ...]
    files: tuple[Path, ...]


@contextmanager
def analysed(directory: Path) -> Iterator[Bench]:
    """Two runs of the 100 W servo, fitted alone and together."""
    files = []
    for number, run in enumerate(campaign(motor_named("servo 100 W"), seed=3, runs=2, rows=400)):
        files.append(directory / f"run{number}.csv")
        write_run(run, files[-1])
    options = {"posterior": False, "effects": False}
    settings = {"PIPELINE": "identification.pipeline:identify"}
    with (
        serving(Path(directory, "data"), "--no-auth", **settings) as server,
        Client(server.url) as client,
        httpx.Client(base_url=server.url, timeout=60) as http,
    ):
        runs = tuple(client.upload(file, motor=MOTOR).id for file in files)
        fits = [
            client.wait(client.fit(some, motor=MOTOR, options=options)).id
            for some in (runs[:1], runs)
        ]
        yield Bench(server, http, fits[0], fits[1], runs, tuple(files))
