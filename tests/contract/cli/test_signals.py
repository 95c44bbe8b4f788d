"""Commands that are ended from outside: a status, one line, no process left, and a way to go on."""

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
    """A word in the environment of all processes of a test."""
    return secrets.token_hex(8)


@pytest.fixture
def manifest(tmp_path: Path) -> Path:
    """Six motors, each of which takes two seconds."""
    (tmp_path / "a.csv").write_bytes(run_text(1))
    rows = "".join(f"m{number},a.csv,{SLOW}\n" for number in range(6))
    (tmp_path / "m.csv").write_text(f"motor,training,seed\n{rows}")
    return tmp_path / "m.csv"


def begin(mark: str, *words: str) -> subprocess.Popen[str]:
    """The command in a process of its own, with the pretended pipeline."""
    names = {"PYTHONPATH": str(ROOT), "MOTORID_PIPELINE": PRETENDED, "MOTORID_MARK": mark}
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | names,
    )


def until(condition: Callable[[], object], seconds: float = 60.0) -> bool:
    """Whether something happens in time."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return bool(condition())


def in_work(mark: str) -> list[int]:
    """Processes besides the command and the fork server: those that fit."""
    found = marked(mark)
    return found if len(found) >= 3 else []


@pytest.mark.parametrize(("number", "status", "told"), ENDS, ids=lambda value: str(value)[:12])
def test_batch_that_is_ended_leaves_no_process_and_goes_on(
    manifest: Path, tmp_path: Path, mark: str, number: int, status: int, told: str
) -> None:
    """One motor is done and two run: one line, and the same command keeps what is done.

    On a busy machine the batch may be over before it is looked at; then it is begun again.
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
    again = begin(mark, "batch", str(manifest), "--out", str(out), "--jobs", "2", "--quiet")
    assert (again.communicate(timeout=120)[1], again.returncode) == ("", 0)
    with (out / "results.csv").open(encoding="utf-8") as file:
        statuses = [row["status"] for row in csv.DictReader(file)]
    assert (len(statuses), "kept" in statuses, statuses[-1]) == (6, True, "fitted")


def interrupted(mark: str, manifest: Path, out: Path, number: int) -> subprocess.Popen[str] | None:
    """A batch that was sent a signal with one motor done and others running; None if it is over.

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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_batch_whose_fork_server_is_killed_fits_its_motors_again(
    manifest: Path, tmp_path: Path, mark: str, number: int
) -> None:
    """The oldest process of the two that stay is the command; neither signal ends the other."""
    process = begin(mark, "batch", str(manifest), "--out", str(tmp_path / "out"), "--quiet")
    assert until(lambda: in_work(mark))
    (server,) = [
        found
        for found in marked(mark)
        if b"app.fork_server.process" in Path(f"/proc/{found}/cmdline").read_bytes()
        and f"PPid:\t{process.pid}\n" in Path(f"/proc/{found}/status").read_text()
    ]
    os.kill(server, number)
    time.sleep(0.2)
    assert process.poll() is None
    assert kill(server)

    assert (process.communicate(timeout=120)[1], process.returncode) == ("", 0)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_service_that_is_ended_stops_in_good_order(tmp_path: Path, mark: str, number: int) -> None:
    """Status 0, whichever signal; no process is left and no traceback is printed."""
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
    """A descriptor that a shell closed is not taken by a file either."""
    (tmp_path / "m.csv").write_text("motor,training,seed\nm,a.csv,0\n")
    given = str(manifest if run == "a.csv" else tmp_path / run)
    line = f'"$0" -c "$1" batch "$2" --out "$3" {closing}'
    words = ["bash", "-c", line, sys.executable, COMMAND, given, str(tmp_path / "out")]
    names = {"PYTHONPATH": str(ROOT), "MOTORID_PIPELINE": PRETENDED, "MOTORID_MARK": mark}

    done = subprocess.run(words, env=os.environ | names, capture_output=True, timeout=120)

    assert done.returncode == status
    assert b"Traceback" not in done.stderr
    assert b"internal error" not in done.stderr


def test_signal_that_a_library_turned_into_its_own_error_is_known(
    run_files: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Some C extensions answer any exception of a callback with one of theirs."""

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
