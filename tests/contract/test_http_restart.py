"""Accepted work survives kills of the server and its processes, and clean shutdowns."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import httpx

from app.identifiers import new_id
from app.settings import load_settings
from app.storage import Storage
from tests.app.pretended import FAMILY, QUICK, SLOW
from tests.app.service import Caller, Server, run_text, serving

NO_AUTH = "--no-auth"
SAID = ["stopping", "fit requeued", "stopped"]
COMMAND = [sys.executable, "-c", "import sys; from app.cli import main; sys.exit(main())"]


def children(process: int) -> list[int]:
    """Child processes that have not ended."""
    found = []
    for directory in Path("/proc").iterdir():
        if directory.name.isdigit():
            try:
                state, parent = (directory / "stat").read_text().rsplit(")", 1)[1].split()[:2]
            except (FileNotFoundError, ProcessLookupError):
                continue
            if int(parent) == process and state != "Z":
                found.append(int(directory.name))
    return found


def fork_server(server: Server) -> int:
    """Process ID of the fork server for the fits of a server."""
    [found] = [
        process
        for process in children(server.process.pid)
        if b"app.fits.worker" in Path(f"/proc/{process}/cmdline").read_bytes()
    ]
    return found


def worker(server: Server) -> int:
    """Process ID of a computing process, as soon as there is one."""
    deadline = time.monotonic() + 20
    while not (found := children(fork_server(server))):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return found[0]


def is_gone(*things: int | Path) -> bool:
    """Return True if processes end or files vanish within 20 s."""
    paths = [Path(f"/proc/{thing}") if isinstance(thing, int) else thing for thing in things]
    deadline = time.monotonic() + 20
    while any(path.exists() for path in paths):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def running_in_database(data_dir: Path) -> dict[str, str]:
    """Status of each fit, read directly from the database file."""
    with sqlite3.connect(data_dir / "motorid.sqlite3") as connection:
        rows = dict(connection.execute("SELECT id, status FROM fits"))
    connection.close()
    return rows


def interrupted_leftovers(data_dir: Path) -> list[Path]:
    """Old files without rows: an incomplete upload and a run."""
    storage = Storage(data_dir, load_settings().node)
    left = [storage.new_incoming(), storage.run(new_id("run"))]
    for path in left:
        path.write_bytes(b"half a run")
        os.utime(path, (0, 0))
    return left


def test_fits_survive_a_kill_of_the_server_and_end_exactly_once(data_dir: Path) -> None:
    """At the kill one fit has ended, one runs, two wait and one is cancelled.

    After the restart all unfinished fits succeed, the others are unchanged, and the leftover
    files are removed.
    """
    with serving(data_dir, NO_AUTH, WORKERS=1) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        ended = caller.wait(caller.begin(run)["id"])
        slow = caller.begin(run, seed=SLOW)["id"]
        waiting = [caller.begin(run, seed=QUICK)["id"] for _ in range(2)]
        cancelled = caller.begin(run, seed=QUICK)["id"]
        caller.http.delete(f"/fits/{cancelled}")
        processes = [worker(server), fork_server(server)]
        server.kill()

    assert is_gone(*processes)
    assert running_in_database(data_dir)[slow] == "running"
    left = interrupted_leftovers(data_dir)

    with serving(data_dir, NO_AUTH, WORKERS=2) as server, Caller(server) as caller:
        again = [caller.wait(fit) for fit in (slow, *waiting)]
        first, last = caller.fit(ended["id"]), caller.fit(cancelled)

    assert [fit["status"] for fit in again] == ["succeeded"] * 3
    assert [fit["attempt"] for fit in again] == [2, 1, 1]
    assert all(fit["result"]["runs"] == ended["result"]["runs"] for fit in again)
    assert first == ended
    assert (last["status"], last["attempt"]) == ("cancelled", 0)
    assert is_gone(*left)
    for fit in (ended, *again):
        # Other attempts leave no files; they are removed just after the end is reported.
        kept = data_dir / "fits" / fit["id"]
        assert is_gone(*(path for path in kept.iterdir() if path.name != str(fit["attempt"])))


def test_fit_survives_kills_of_its_process_and_a_shutdown(
    data_dir: Path,
) -> None:
    """A kill of its process counts against the fit, a kill of the fork server does not.

    SIGTERM then stops the service and its event streams in time, with status 0 and a log entry.
    """
    with serving(data_dir, NO_AUTH) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        fit = caller.begin(run, seed=FAMILY)["id"]
        first = worker(server)
        os.kill(first, signal.SIGKILL)
        assert is_gone(first)
        second = worker(server)
        os.kill(fork_server(server), signal.SIGKILL)
        assert is_gone(second)
        processes = [worker(server), fork_server(server)]
        with caller.http.stream("GET", f"/fits/{fit}/events") as answer:
            lines = answer.iter_lines()
            assert next(lines).startswith("retry")
            began = time.monotonic()
            status = server.stop()
            took = time.monotonic() - began
            rest = list(lines)

        assert status == 0
        messages = [json.loads(line)["message"] for line in server.log if line.startswith("{")]
        assert [m for m in messages if m in SAID] == SAID
        assert took < 8
        assert "event: end" not in rest
        assert is_gone(*processes)

    with sqlite3.connect(data_dir / "motorid.sqlite3") as connection:
        rows = list(connection.execute("SELECT status, attempt, failures FROM fits"))
    connection.close()
    assert rows == [("queued", 3, 1)]


def test_second_server_on_one_data_directory_is_refused(server: Server) -> None:
    """It exits with status 2 and the reason; the first server is not affected."""
    words = ["serve", "--port", "0", "--data-dir", str(server.data_dir)]

    second = subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=60)

    assert second.returncode == 2
    assert "another server already uses" in second.stderr.splitlines()[-1]
    assert "Traceback" not in second.stderr
    assert httpx.get(f"{server.url}/readyz").status_code == 200


def test_serving_without_keys_off_loopback_is_refused(data_dir: Path) -> None:
    """The command exits with status 2 and one line."""
    words = ["serve", "--host", "0.0.0.0", "--no-auth", "--data-dir", str(data_dir)]

    refused = subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=60)

    assert refused.returncode == 2
    assert len(refused.stderr.splitlines()) == 1
    assert "no_auth" in refused.stderr
