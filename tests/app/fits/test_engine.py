"""Compute engines with real processes: the same tests for both engines."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.fits.engine import AbstractEngine, AbstractRunning, LocalEngine
from app.fits.job import FitJob, RunFile
from app.fork_server.child import child_environment
from app.fork_server.client import ForkServer
from app.settings import load_settings
from app.storage import Storage
from tests.app.cluster import Cluster
from tests.app.pretended import (
    BAD_INPUT,
    FAMILY,
    KILLED,
    NO_SOLUTION,
    QUICK,
    RAISES,
    SILENT,
    SLOW,
)
from tests.app.service import PRETENDED, run_text


def job(directory: Path, seed: int) -> FitJob:
    """Job that runs the mock pipeline."""
    (directory / "run").write_bytes(run_text(1))
    run = RunFile(str(directory / "run"), "a.csv", None)
    options = {"seed": seed, "controllers": ["P:1"], "temperatures": [25.0]}
    return FitJob("fit", 1, str(directory), (run,), (), options, PRETENDED)


@pytest.fixture(scope="module", params=["local", "dask"])
def engine(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[AbstractEngine]:
    """Local engine and Dask engine, each with the mock pipeline."""
    directory = tmp_path_factory.mktemp("engine")
    if request.param == "local":
        fork_server = ForkServer(
            "app.fits.worker", PRETENDED.partition(":")[0], temporary=directory
        )
        with opened(LocalEngine(fork_server, 2)) as engine:
            yield engine
        return
    from app.fits.dask_engine import DaskEngine

    with Cluster.running(directory / "cluster") as cluster:
        settings = load_settings(engine="dask", dask_scheduler=cluster.address)
        # The paths of jobs must be below the data directory of the Dask engine.
        storage = Storage(tmp_path_factory.getbasetemp(), "bench")
        with opened(DaskEngine(settings, storage)) as engine:
            yield engine


@contextmanager
def opened(engine: AbstractEngine) -> Iterator[AbstractEngine]:
    """Open an engine, wait until it has capacity, and close it after the block."""
    engine.open()
    try:
        deadline = time.monotonic() + 30
        while not engine.capacity():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield engine
    finally:
        engine.close()


def is_running(process: int) -> bool:
    """Return True if a process has not ended; a zombie has ended."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def ended(running: AbstractRunning) -> tuple[str, list[dict[str, Any]]]:
    """End of a job and all its messages."""
    told: list[dict[str, Any]] = []
    deadline = time.monotonic() + 60
    while (end := running.exit()) is None:
        told += running.messages()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    told += running.messages()
    running.kill()
    return end, told


def test_job_reports_progress_and_completion(tmp_path: Path, engine: AbstractEngine) -> None:
    """The stages are reported in order; `done` is the last message."""
    running = engine.start(job(tmp_path, QUICK))

    end, told = ended(running)

    assert end == "exit status 0"
    assert told[-1] == {"done": True}
    stages = [message["progress"]["stage"] for message in told[:-1]]
    assert stages == ["reading", "fit", "report", "writing"]
    assert (tmp_path / "result.json").is_file()


@pytest.mark.parametrize(("seed", "end"), [(RAISES, "exit status 1"), (SILENT, "exit status 0")])
def test_crash_sends_neither_done_nor_failed(
    tmp_path: Path, engine: AbstractEngine, seed: int, end: str
) -> None:
    """After an exception the log contains the traceback."""
    running = engine.start(job(tmp_path, seed))

    found, told = ended(running)

    assert found == end
    assert all(set(message) == {"progress"} for message in told)
    assert ("RuntimeError: a bug" in running.log_tail()) == (seed == RAISES)


@pytest.mark.parametrize(
    ("seed", "failed"),
    [
        (BAD_INPUT, {"code": "input", "file": "a.csv", "row": 7, "column": "speed_rad_s"}),
        (NO_SOLUTION, {"code": "computation"}),
    ],
)
def test_job_reports_an_expected_error(
    tmp_path: Path, engine: AbstractEngine, seed: int, failed: dict[str, Any]
) -> None:
    """The message carries the error with its source location; the process exits normally."""
    end, told = ended(engine.start(job(tmp_path, seed)))

    assert end == "exit status 0"
    assert failed.items() <= told[-1]["failed"].items()


def test_killed_job_ends_with_its_child_within_a_second(
    tmp_path: Path, engine: AbstractEngine
) -> None:
    """The mock fit writes the IDs of its process and of its child to a file."""
    running = engine.start(job(tmp_path, FAMILY))
    pids = tmp_path / "pids"
    deadline = time.monotonic() + 30
    while not (pids.exists() and len(pids.read_text().split()) == 2):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    processes = [int(pid) for pid in pids.read_text().split()]
    assert running.exit() is None

    began = time.monotonic()
    running.kill()
    while any(map(is_running, processes)):
        assert time.monotonic() < began + 1.0
        time.sleep(0.005)

    assert running.exit() is not None


def test_crash_of_one_job_does_not_affect_another(tmp_path: Path, engine: AbstractEngine) -> None:
    """A job succeeds although another one is killed by a signal while it runs."""
    slow, killed = tmp_path / "slow", tmp_path / "killed"
    for directory in (slow, killed):
        directory.mkdir()
    beside = engine.start(job(slow, SLOW))
    end, _ = ended(engine.start(job(killed, KILLED)))

    assert end == "signal 9 (SIGKILL)"
    assert ended(beside)[1][-1] == {"done": True}


def test_job_survives_a_json_round_trip(tmp_path: Path) -> None:
    """Runs, mappings and options are equal after encoding and decoding."""
    run = RunFile("/data/runs/x", "ä.csv", {"current_A": {"column": "i", "scale": 2.5}})
    saved = FitJob("fit", 3, str(tmp_path), (run,), (run, run), {"seed": 1}, "a:b")

    sent = json.loads(json.dumps(dataclasses.asdict(saved)))

    assert FitJob.of(sent) == saved


@pytest.mark.parametrize(
    ("workers", "told", "jobs", "threads"),
    [(4, None, 1, 4), (4, None, 2, 2), (4, None, 3, 1), (4, None, 90, 1), (1, None, 90, 4)]
    + [(9, None, 9, 1), (4, 3, 1, 3), (4, 3, 90, 3)],
)
def test_threads_are_an_equal_share_of_the_cores_unless_set(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    workers: int,
    told: int | None,
    jobs: int,
    threads: int,
) -> None:
    """The share is rounded down and at least one; more threads than cores would only wait."""
    monkeypatch.setattr("app.fits.engine.cores", lambda: 4)
    fork_server = ForkServer("app.fits.worker", temporary=tmp_path)

    assert LocalEngine(fork_server, workers, told).threads(jobs) == threads


def test_secrets_of_the_server_do_not_reach_the_computing_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The URL of the database may contain a password."""
    monkeypatch.setenv("MOTORID_DATABASE_URL", "postgresql://user:password@host/base")

    environment = child_environment(tmp_path)

    assert "password" not in str(environment)
    assert environment["PATH"] == os.environ["PATH"]
    assert environment["OPENBLAS_NUM_THREADS"] == "1"
