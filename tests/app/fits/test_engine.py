"""Processes that compute, started and ended for real."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.confine import child_environment
from app.fits.engine import AbstractRunning, LocalEngine
from app.fits.job import Job, RunFile
from app.nursery.client import Nursery
from tests.app.pretended import QUICK, RAISES, SILENT
from tests.app.service import PRETENDED, run_text


def job(directory: Path, seed: int) -> Job:
    """A job of the pretended pipeline."""
    (directory / "run").write_bytes(run_text(1))
    run = RunFile(str(directory / "run"), "a.csv", None)
    options = {"seed": seed, "controllers": ["P:1"], "temperatures": [25.0]}
    return Job("fit", 1, str(directory), (run,), (), options, PRETENDED)


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalEngine]:
    """An engine whose processes know the pretended pipeline."""
    directory = tmp_path_factory.mktemp("engine")
    nursery = Nursery("app.fits.worker", PRETENDED.partition(":")[0], temporary=directory)
    yield LocalEngine(nursery)
    nursery.stop()


def ended(running: AbstractRunning) -> tuple[str, list[dict[str, Any]]]:
    """How a process ended, and everything that it told."""
    told: list[dict[str, Any]] = []
    deadline = time.monotonic() + 60
    while (end := running.exit()) is None:
        told += running.messages()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    told += running.messages()
    running.kill()
    return end, told


def test_job_is_computed_in_a_group_of_its_own(tmp_path: Path, engine: LocalEngine) -> None:
    """It tells its progress in order and, last, that all is on the disk."""
    running = engine.start(job(tmp_path, QUICK))

    end, told = ended(running)

    assert end == "exit status 0"
    assert told[-1] == {"done": True}
    stages = [message["progress"]["stage"] for message in told[:-1]]
    assert stages == ["reading", "fit", "report", "writing"]
    assert (tmp_path / "result.json").is_file()


@pytest.mark.parametrize(("seed", "end"), [(RAISES, "exit status 1"), (SILENT, "exit status 0")])
def test_crash_is_told_from_an_end(
    tmp_path: Path, engine: LocalEngine, seed: int, end: str
) -> None:
    """A bug prints its trace for the log; neither says that it is done or why it failed."""
    running = engine.start(job(tmp_path, seed))

    found, told = ended(running)

    assert found == end
    assert all(set(message) == {"progress"} for message in told)
    assert ("RuntimeError: a bug" in running.log_tail()) == (seed == RAISES)


def test_job_comes_out_as_it_was_sent(tmp_path: Path) -> None:
    """Runs with their mappings, options and all."""
    run = RunFile("/data/runs/x", "ä.csv", {"current_A": {"column": "i", "scale": 2.5}})
    saved = Job("fit", 3, str(tmp_path), (run,), (run, run), {"seed": 1}, "a:b")

    sent = json.loads(json.dumps(dataclasses.asdict(saved)))

    assert Job.of(sent) == saved


def test_secrets_of_the_server_do_not_reach_the_computing_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The address of the database may hold a password."""
    monkeypatch.setenv("MOTORID_DATABASE_URL", "postgresql://user:password@host/base")

    environment = child_environment(tmp_path)

    assert "password" not in str(environment)
    assert environment["PATH"] == os.environ["PATH"]
    assert environment["OPENBLAS_NUM_THREADS"] == "1"
