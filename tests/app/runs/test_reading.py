"""Reading in a process with limits: what a file does to its reader reaches nobody else."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.confine import Limits
from app.errors import RunRefused
from app.runs.reading import RunReader
from tests.app.service import run_text

LIMITS = Limits(memory_bytes=2_000_000_000, cpu_s=60, wall_s=60.0)


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunReader]:
    """A reader with the limits of the service."""
    made = RunReader(LIMITS, 1_000_000, tmp_path_factory.mktemp("reader"))
    yield made
    made.stop()


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run file of 60 samples."""
    path = tmp_path / "run"
    path.write_bytes(run_text(1))
    return path


def limited(reader: RunReader, limits: Limits) -> None:
    """Have the next readings keep to other limits; the process need not start again."""
    reader._limits = limits


def process_of(reader: RunReader) -> int:
    """The process that forks the readings."""
    reader.start()
    assert reader._process is not None
    return reader._process.pid


def test_run_is_read_and_told_about(reader: RunReader, run: Path) -> None:
    """60 samples at 1 kHz, as the file was made, with the ranges of its channels."""
    found = reader.read(run, "a.csv", None)

    assert (found["rows"], found["duration_s"]) == (60, pytest.approx(0.059))
    assert set(found["channels"]) == {
        "voltage_V",
        "current_A",
        "speed_rad_s",
        "temperature_degC",
    }


def test_fault_comes_back_with_its_place(reader: RunReader, run: Path) -> None:
    """Row 3 holds a word."""
    lines = run_text(1).split(b"\n")
    lines[2] = lines[2].replace(b",", b",x,", 1).rsplit(b",", 1)[0]
    run.write_bytes(b"\n".join(lines))

    with pytest.raises(RunRefused, match=r"a\.csv, row 3") as caught:
        reader.read(run, "a.csv", None)

    assert (caught.value.reason, caught.value.row) == ("not_a_number", 3)


def test_many_runs_are_read_at_once_and_none_is_mixed_up(reader: RunReader, tmp_path: Path) -> None:
    """Twelve files of 60 to 71 samples from twelve threads."""
    found: dict[int, int] = {}

    def read(rows: int) -> None:
        path = tmp_path / str(rows)
        path.write_bytes(run_text(rows, rows))
        found[rows] = reader.read(path, "a.csv", None)["rows"]

    threads = [threading.Thread(target=read, args=(rows,)) for rows in range(60, 72)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert found == {rows: rows for rows in range(60, 72)}


def test_reading_beyond_its_memory_is_refused_by_name(reader: RunReader, run: Path) -> None:
    """A hundred thousand rows within a limit that numpy and pandas fill already."""
    run.write_bytes(run_text(1, 100_000))
    status = Path(f"/proc/{process_of(reader)}/statm").read_text().split()[0]
    reader.read(run, "warm.csv", None)
    used = int(Path(f"/proc/{process_of(reader)}/statm").read_text().split()[0]) * 4096
    assert int(status) > 0
    limited(reader, Limits(memory_bytes=used + 2_000_000, cpu_s=60, wall_s=60.0))
    try:
        with pytest.raises(RunRefused, match="GB|reader fail") as caught:
            reader.read(run, "big.csv", None)
    finally:
        limited(reader, LIMITS)

    assert caught.value.reason in ("reader_memory", "reader_crash")
    assert reader.read(run, "again.csv", None)["rows"] == 100_000


def test_reading_beyond_its_time_is_ended(reader: RunReader, run: Path) -> None:
    """Twenty milliseconds for a hundred thousand rows."""
    run.write_bytes(run_text(1, 100_000))
    limited(reader, Limits(memory_bytes=2_000_000_000, cpu_s=60, wall_s=0.02))
    began = time.monotonic()
    try:
        with pytest.raises(RunRefused, match="takes more than") as caught:
            reader.read(run, "slow.csv", None)
    finally:
        limited(reader, LIMITS)

    assert caught.value.reason == "reader_time"
    assert time.monotonic() - began < 20


def test_reader_that_was_killed_is_started_again(reader: RunReader, run: Path) -> None:
    """The next upload notices nothing but the time."""
    os.kill(process_of(reader), signal.SIGKILL)

    assert reader.read(run, "a.csv", None)["rows"] == 60


def test_reader_ends_with_its_server(tmp_path: Path, run: Path) -> None:
    """Nothing is left when the other end of its socket closes."""
    own = RunReader(LIMITS, 1_000_000, tmp_path)
    process = process_of(own)
    assert own._socket is not None
    assert own._process is not None

    own._socket.close()

    assert own._process.wait(timeout=30) == 0
    assert not Path(f"/proc/{process}").exists()
