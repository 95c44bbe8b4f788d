"""Commands ended by a signal: status, one line, no process left, and a resumable state."""

from __future__ import annotations

import csv
import os
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from app.cli import main
from benchmarks.torture.processes import kill, marked
from tests.app.pretended import SLOW
from tests.app.service import PRETENDED, run_text

ROOT = Path(__file__).parents[3]
COMMAND = "import sys; from app.cli import main; sys.exit(main())"
ENDS = [
    (signal.SIGTERM, 143, "motorid: terminated by SIGTERM\n"),
    (signal.SIGHUP, 129, "motorid: terminated by SIGHUP\n"),
    (signal.SIGINT, 130, "motorid: interrupted\n"),
]


_ATTEMPTS = 3


@pytest.fixture
def mark() -> str:
    """Value in the environment of all processes of a test."""
    return secrets.token_hex(8)


@pytest.fixture
def manifest(tmp_path: Path) -> Path:
    """Four motors, each with a fit of two seconds."""
    (tmp_path / "a.csv").write_bytes(run_text(1))
    rows = "".join(f"m{number},a.csv,{SLOW}\n" for number in range(4))
    (tmp_path / "m.csv").write_text(f"motor,training,seed\n{rows}")
    return tmp_path / "m.csv"


def begin(mark: str, *words: str) -> subprocess.Popen[str]:
    """Start the command with the mock pipeline in a separate process."""
    names = {"PYTHONPATH": str(ROOT), "MOTORID_PIPELINE": PRETENDED, "MOTORID_MARK": mark}
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | names,
    )


def until(condition: Callable[[], object], seconds: float = 60.0) -> bool:
    """Return True if a condition becomes true in time."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return bool(condition())


def in_work(mark: str) -> list[int]:
    """Processes of the command if some compute in addition to the command and the fork server."""
    found = marked(mark)
    return found if len(found) >= 3 else []


@pytest.mark.parametrize(("number", "status", "told"), ENDS, ids=lambda value: str(value)[:12])
def test_interrupted_batch_leaves_no_process_and_is_resumed(
    manifest: Path, tmp_path: Path, mark: str, number: int, status: int, told: str
) -> None:
    """With one motor done and others running, a signal ends the batch with one line.

    On a busy machine the batch may end before the signal; the test then starts another one.
    """
    outs = [tmp_path / f"out{attempt}" for attempt in range(_ATTEMPTS)]
    out, process = next(
        (out, process)
        for out in outs
        if (process := interrupted(mark, manifest, out, number)) is not None
    )
    _, said = process.communicate(timeout=60)

    assert (process.returncode, said) == (status, told)
    assert until(lambda: not marked(mark), 5.0)
    again = begin(mark, "batch", str(manifest), "--out", str(out), "--jobs", "4", "--quiet")
    assert (again.communicate(timeout=120)[1], again.returncode) == ("", 0)
    with (out / "results.csv").open(encoding="utf-8") as file:
        statuses = [row["status"] for row in csv.DictReader(file)]
    assert (len(statuses), "kept" in statuses, statuses[-1]) == (4, True, "fitted")


def interrupted(mark: str, manifest: Path, out: Path, number: int) -> subprocess.Popen[str] | None:
    """Batch that received a signal after its first motor; None if the batch ended before.

    The record of a motor, batch.json, is written last: from then on its result is kept.
    """
    process = begin(mark, "batch", str(manifest), "--out", str(out), "--jobs", "2")

    def done() -> bool:
        return any(out.glob("m*/batch.json")) and bool(in_work(mark))

    if until(lambda: done() or process.poll() is not None, 30.0) and process.poll() is None:
        process.send_signal(number)
        return process
    process.kill()
    process.communicate(timeout=60)
    return None


def test_batch_whose_fork_server_is_killed_fits_its_motors_again(
    manifest: Path, tmp_path: Path, mark: str
) -> None:
    """The fork server ignores signals for the command; after SIGKILL its motors are retried."""
    manifest.write_text("".join(manifest.read_text().splitlines(keepends=True)[:3]))
    process = begin(mark, "batch", str(manifest), "--out", str(tmp_path / "out"), "--quiet")
    assert until(lambda: in_work(mark))
    (server,) = [
        found
        for found in marked(mark)
        if b"app.fork_server.process" in Path(f"/proc/{found}/cmdline").read_bytes()
        and f"PPid:\t{process.pid}\n" in Path(f"/proc/{found}/status").read_text()
    ]
    for number, _, _ in ENDS:
        os.kill(server, number)
    time.sleep(0.2)
    assert process.poll() is None
    assert in_work(mark)
    assert kill(server)

    assert (process.communicate(timeout=120)[1], process.returncode) == ("", 0)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_service_shuts_down_cleanly_at_each_signal(tmp_path: Path, mark: str, number: int) -> None:
    """The status is 0, no process is left and no traceback is printed."""
    process = begin(mark, "serve", "--no-auth", "--port", "0", "--data-dir", str(tmp_path / "data"))
    assert process.stderr is not None
    while "startup complete" not in (line := process.stderr.readline()):
        assert line, "it does not start"

    process.send_signal(number)
    _, said = process.communicate(timeout=60)

    assert process.returncode == 0
    assert "Traceback" not in said
    assert until(lambda: not marked(mark), 5.0)


@pytest.mark.parametrize("closing", [">&-", "2>&-", ">&- 2>&-"])
@pytest.mark.parametrize(("run", "status"), [("nosuch.csv", 2), ("a.csv", 0)])
def test_closed_output_changes_no_status(
    manifest: Path, tmp_path: Path, mark: str, closing: str, run: str, status: int
) -> None:
    """The descriptor of a closed stream is not reused for a file."""
    (tmp_path / "m.csv").write_text("motor,training,seed\nm,a.csv,0\n")
    given = str(manifest if run == "a.csv" else tmp_path / run)
    line = f'"$0" -c "$1" batch "$2" --out "$3" {closing}'
    words = ["bash", "-c", line, sys.executable, COMMAND, given, str(tmp_path / "out")]
    names = {"PYTHONPATH": str(ROOT), "MOTORID_PIPELINE": PRETENDED, "MOTORID_MARK": mark}

    done = subprocess.run(words, env=os.environ | names, capture_output=True, timeout=120)

    assert done.returncode == status
    assert b"Traceback" not in done.stderr
    assert b"internal error" not in done.stderr


def test_signal_converted_by_a_library_is_recognised(
    run_files: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Some C extensions convert any exception of a callback into their own."""

    def identify(*given: object, **named: object) -> NoReturn:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1.0)
        except BaseException as error:
            raise RuntimeError("conversion failed") from error
        raise AssertionError("no signal came")

    monkeypatch.setattr("identification.pipeline.identify", identify)

    status = main(["fit", str(run_files[0]), "--out", str(tmp_path / "out"), "-q"])

    assert (status, capsys.readouterr().err) == (143, "motorid: terminated by SIGTERM\n")
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
