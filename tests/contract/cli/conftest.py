"""Runs on disk and a finished fit that the tests of the command line share."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.cli import main
from identification.ingest import write_run
from tests.motors import campaign, motor_named


@pytest.fixture(autouse=True)
def signals_end_processes() -> Iterator[None]:
    """Reset signals that a shell ignores for background jobs; child processes inherit them."""
    hangup = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    interrupt = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGHUP, hangup)
    signal.signal(signal.SIGINT, interrupt)


@pytest.fixture(scope="session")
def run_files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Four short runs of the 100 W servo with 1 % noise, in order of rising temperature."""
    directory = tmp_path_factory.mktemp("bench")
    runs = campaign(motor_named("servo 100 W"), seed=3, runs=4, rows=800)
    files = [directory / f"run{number}.csv" for number in range(1, 5)]
    for run, file in zip(runs, files, strict=True):
        write_run(run, file)
    return files


@pytest.fixture(scope="session")
def fitted(run_files: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of a fit without posterior: three training runs, one validation run."""
    out = tmp_path_factory.mktemp("fit") / "motor"
    training, validation = run_files[:3], run_files[3:]

    words = ["fit", *map(str, training), "--validation", *map(str, validation), "--out", str(out)]
    status = main([*words, "--no-posterior", "--no-effects", "--quiet"])

    assert status == 0
    return out
