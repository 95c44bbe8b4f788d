"""Parsing of uploads in processes with resource limits, and the queue of uploads."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import anyio
import pytest

from app.errors import RunRefused, TooManyUploads
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer
from app.runs.reading import ReadingQueue, RunReader
from tests.app.service import HEADER, run_text

LIMITS = ProcessLimits(memory_bytes=2_000_000_000, cpu_s=60, wall_s=60.0)


@pytest.fixture(scope="module")
def fork_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkServer]:
    """Fork server of the parser processes."""
    made = ForkServer("app.runs.parser", temporary=tmp_path_factory.mktemp("reader"))
    yield made
    made.stop()


@pytest.fixture
def reader(fork_server: ForkServer) -> RunReader:
    """Reader with generous resource limits."""
    return RunReader(fork_server, LIMITS, 1_000_000)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Run file of 60 samples."""
    path = tmp_path / "run"
    path.write_bytes(run_text(1))
    return path


def test_reader_returns_a_summary_of_the_run(reader: RunReader, run: Path) -> None:
    """The summary has the number of samples, the duration and the channels."""
    found = reader.read(run, "a.csv", None)

    assert (found["rows"], found["duration_s"]) == (60, pytest.approx(0.059))
    assert set(found["channels"]) == {
        "voltage_V",
        "current_A",
        "speed_rad_s",
        "temperature_degC",
    }


def test_error_has_its_source_location(reader: RunReader, run: Path) -> None:
    """Row 3 contains a word in place of a number."""
    lines = run_text(1).split(b"\n")
    lines[2] = lines[2].replace(b",", b",x,", 1).rsplit(b",", 1)[0]
    run.write_bytes(b"\n".join(lines))

    with pytest.raises(RunRefused, match=r"a\.csv, row 3") as caught:
        reader.read(run, "a.csv", None)

    assert (caught.value.reason, caught.value.row) == ("not_a_number", 3)


def test_parallel_readings_do_not_mix(reader: RunReader, tmp_path: Path) -> None:
    """Each of twelve files of different lengths gives its own number of samples."""
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


def test_reading_beyond_the_memory_limit_is_refused(fork_server: ForkServer, run: Path) -> None:
    """The limit leaves no memory for the 40 MB of a million rows with 5 numbers."""
    plain = RunReader(fork_server, LIMITS, 1_000_000)
    assert plain.read(run, "first.csv", None)["rows"] == 60
    used = int(Path(f"/proc/{fork_server.pid}/statm").read_text().split()[0]) * os.sysconf(
        "SC_PAGESIZE"
    )
    limits = ProcessLimits(memory_bytes=used, cpu_s=60, wall_s=60.0)
    big = run.with_name("big")
    rows = (f"{k / 1000},{k % 7},{k % 5},{k % 11},25\n" for k in range(1_000_000))
    big.write_text(f"{HEADER}\n" + "".join(rows))

    with pytest.raises(RunRefused, match="GB|reader fail") as caught:
        RunReader(fork_server, limits, 1_000_000).read(big, "big.csv", None)

    assert caught.value.reason in ("reader_memory", "reader_crash")
    assert plain.read(run, "again.csv", None)["rows"] == 60


def test_reader_may_open_few_files_and_write_none(fork_server: ForkServer, run: Path) -> None:
    """The kernel reports the limits of the parser process while it reads a long run."""
    run.write_bytes(run_text(1, 300_000))
    task = fork_server.fork(
        {
            "path": str(run),
            "name": "a.csv",
            "mapping": None,
            "max_rows": 1_000_000,
            "limits": dataclasses.asdict(LIMITS),
            "kind": "run",
        }
    )
    try:
        limits = _limits_of_the_child_of(fork_server.pid)
    finally:
        task.kill()

    assert limits["Max open files"] == str(LIMITS.files)
    assert limits["Max file size"] == "0"
    assert limits["Max address space"] == str(LIMITS.memory_bytes)
    assert limits["Max cpu time"] == str(LIMITS.cpu_s)
    assert limits["Max core file size"] == "0"


def _limits_of_the_child_of(parent: int | None) -> dict[str, str]:
    """Soft limits of the only child of a process, after it has set them."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        time.sleep(0.02)
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        for child in children:
            try:
                text = Path(f"/proc/{child}/limits").read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue
            found = {line[:26].strip(): line[26:47].strip() for line in text.splitlines()[1:]}
            # The time limit is set last.
            if found["Max cpu time"] != "unlimited":
                return found
    raise AssertionError("no child was found")


def test_reading_beyond_the_time_limit_is_ended(fork_server: ForkServer, run: Path) -> None:
    """The limit of 20 ms is too short for a hundred thousand rows."""
    run.write_bytes(run_text(1, 100_000))
    limits = ProcessLimits(memory_bytes=2_000_000_000, cpu_s=60, wall_s=0.02)

    with pytest.raises(RunRefused, match="takes more than") as caught:
        RunReader(fork_server, limits, 1_000_000).read(run, "slow.csv", None)

    assert caught.value.reason == "reader_time"


def test_too_many_rows_are_refused(fork_server: ForkServer, run: Path) -> None:
    """Sixty samples exceed a limit of fifty."""
    with pytest.raises(RunRefused, match="50"):
        RunReader(fork_server, LIMITS, max_rows=50).read(run, "a.csv", None)


def test_full_queue_refuses_a_further_upload() -> None:
    """With one upload read and two waiting, a fourth is rejected with a retry time."""
    release = threading.Event()
    read: list[int] = []

    def reading(number: int) -> None:
        """Simulate a reading that ends when the test releases it."""
        assert release.wait(30.0)
        read.append(number)

    async def load() -> None:
        """Queue three uploads, then a fourth."""
        queue = ReadingQueue(readers=1, most_waiting=2)
        async with anyio.create_task_group() as group:
            for number in range(3):
                queue.check()
                group.start_soon(queue.run, reading, number)
                await anyio.wait_all_tasks_blocked()
            with pytest.raises(TooManyUploads, match="2 uploads are waiting to be read") as caught:
                queue.check()
            assert 1.0 <= caught.value.retry_after_s <= 60.0
            release.set()
        queue.check()
        await queue.run(reading, 4)

    anyio.run(load)

    assert read == [0, 1, 2, 4]


def test_retry_time_follows_the_mean_reading_time() -> None:
    """Fifty waiting uploads with a mean of 0.23 s give a retry time of at least 11 s."""

    async def load() -> float:
        """Read some uploads, then fill the queue."""
        queue = ReadingQueue(readers=1, most_waiting=50)
        release = threading.Event()
        for _ in range(10):
            await queue.run(release.wait, 0.3)
        async with anyio.create_task_group() as group:
            for _ in range(51):
                group.start_soon(queue.run, release.wait, 30.0)
            await anyio.wait_all_tasks_blocked()
            with pytest.raises(TooManyUploads) as caught:
                queue.check()
            release.set()
        return caught.value.retry_after_s

    # Mean 0.3 - 0.2 * 0.9**10 = 0.23 s, fifty times; a busy machine is slower, never faster.
    assert anyio.run(load) >= 11.0


def test_fork_server_has_the_modules_of_a_preview(run: Path) -> None:
    """A child that imports them itself takes ten times the CPU time of the file."""
    code = """
import sys
from app.runs import parser
before = set(sys.modules)
task = {"path": sys.argv[1], "name": "a.csv", "mapping": None, "is_of_bench": False}
found = parser._pending(task, parser.Limits(rows=1_000))
new = sorted(set(sys.modules) - before)
slow = [name for name in new if name.split(".")[0] in ("identification", "scipy", "casadi")]
print(found["summary"]["rows"], slow)
"""
    command = [sys.executable, "-c", code, str(run)]
    found = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)

    assert found.stdout == "60 []\n"
