"""What was accepted survives: kills of the server and of what computes, and orderly stops."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from tests.app.pretended import QUICK, SLOW
from tests.app.service import Caller, Server, run_text, serving

NO_AUTH = "--no-auth"


def workers(server: Server) -> list[int]:
    """Processes that compute for a server, as the system lists them."""
    found = []
    for directory in Path("/proc").iterdir():
        if directory.name.isdigit():
            try:
                words = (directory / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if b"app.fits.worker" in words and str(server.data_dir).encode() in b" ".join(words):
                found.append(int(directory.name))
    return found


def running_in_database(data_dir: Path) -> dict[str, str]:
    """Status of each fit, read from the file itself."""
    with sqlite3.connect(data_dir / "motorid.sqlite3") as connection:
        rows = dict(connection.execute("SELECT id, status FROM fits"))
    connection.close()
    return rows


def test_fits_survive_a_kill_of_the_server_and_end_exactly_once(data_dir: Path) -> None:
    """One fit ended, one running and two waiting at the kill: all end, the first is left alone."""
    with serving(data_dir, NO_AUTH, WORKERS=1) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        ended = caller.wait(caller.begin(run)["id"])
        slow = caller.begin(run, seed=SLOW)["id"]
        waiting = [caller.begin(run, seed=QUICK)["id"] for _ in range(2)]
        caller.wait(slow, "running")
        [process] = workers(server)
        server.kill()

    deadline = time.monotonic() + 20
    while Path(f"/proc/{process}").exists():
        assert time.monotonic() < deadline, "the computing process outlives its server"
        time.sleep(0.02)
    assert running_in_database(data_dir)[slow] == "running"

    with serving(data_dir, NO_AUTH, WORKERS=2) as server, Caller(server) as caller:
        again = [caller.wait(fit) for fit in (slow, *waiting)]
        first = caller.fit(ended["id"])

    assert [fit["status"] for fit in again] == ["succeeded"] * 3
    assert [fit["attempt"] for fit in again] == [2, 1, 1]
    assert all(fit["result"]["runs"] == ended["result"]["runs"] for fit in again)
    assert first == ended
    for fit in (ended, *again):
        attempts = [path.name for path in (data_dir / "fits" / fit["id"]).iterdir()]
        assert attempts == [str(fit["attempt"])]


def test_fit_survives_the_kill_of_its_process(data_dir: Path) -> None:
    """Killed from outside in its first attempt, as by a machine without memory."""
    with serving(data_dir, NO_AUTH) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        fit = caller.begin(run, seed=SLOW)["id"]
        while not (found := workers(server)):
            time.sleep(0.02)
        os.kill(found[0], signal.SIGKILL)
        ended = caller.wait(fit)

    assert (ended["status"], ended["attempt"]) == ("succeeded", 2)


def test_orderly_stop_ends_event_streams_and_puts_fits_back(data_dir: Path) -> None:
    """SIGTERM: status 0 within the time of a shutdown, nothing computes on, the fit waits."""
    with serving(data_dir, NO_AUTH) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        fit = caller.begin(run, seed=SLOW)["id"]
        caller.wait(fit, "running")
        with caller.http.stream("GET", f"/fits/{fit}/events") as answer:
            lines = answer.iter_lines()
            assert next(lines).startswith("retry")
            began = time.monotonic()
            status = server.stop()
            took = time.monotonic() - began
            rest = list(lines)

        assert status in (0, -signal.SIGTERM)
        assert took < 8
        assert "event: end" not in rest
        assert workers(server) == []
    assert running_in_database(data_dir) == {fit: "queued"}


def test_cancelled_fit_stays_cancelled_over_a_restart(data_dir: Path) -> None:
    """Cancelled while it waited; the next server does not begin it."""
    with serving(data_dir, NO_AUTH, WORKERS=1) as server, Caller(server) as caller:
        run = caller.upload(run_text(1))["id"]
        busy = caller.begin(run, seed=SLOW)["id"]
        waiting = caller.begin(run, seed=QUICK)["id"]
        caller.http.delete(f"/fits/{waiting}")
        server.kill()

    with serving(data_dir, NO_AUTH) as server, Caller(server) as caller:
        caller.wait(busy)
        fit = caller.fit(waiting)

    assert (fit["status"], fit["attempt"]) == ("cancelled", 0)


def test_second_server_on_one_data_directory_is_refused(data_dir: Path) -> None:
    """Exit status 2 and one line that says why; the first server goes on."""
    command = "import sys; from app.cli import main; sys.exit(main())"
    with serving(data_dir, NO_AUTH) as server:
        second = subprocess.run(
            [sys.executable, "-c", command, "serve", "--port", "0", "--data-dir", str(data_dir)],
            capture_output=True,
            text=True,
            timeout=60,
        )

        assert second.returncode == 2
        assert "another server already uses" in second.stderr.splitlines()[-1]
        assert "Traceback" not in second.stderr
        assert httpx.get(f"{server.url}/readyz").status_code == 200


def test_serving_without_keys_off_loopback_is_refused(data_dir: Path) -> None:
    """Exit status 2, one line, and nothing listens."""
    command = "import sys; from app.cli import main; sys.exit(main())"
    words = ["serve", "--host", "0.0.0.0", "--no-auth", "--data-dir", str(data_dir)]

    refused = subprocess.run(
        [sys.executable, "-c", command, *words], capture_output=True, text=True, timeout=60
    )

    assert refused.returncode == 2
    assert len(refused.stderr.splitlines()) == 1
    assert "no_auth" in refused.stderr


@pytest.mark.parametrize("name", ["incoming", "runs"])
def test_rest_of_an_interrupted_upload_is_swept_at_the_start(data_dir: Path, name: str) -> None:
    """An upload that was coming in, and a run whose row was never written, long ago."""
    from app.settings import load_settings
    from app.storage import Storage

    storage = Storage(data_dir, load_settings().node)
    storage.prepare()
    rest = storage.new_incoming() if name == "incoming" else storage.run("run_" + "a" * 26)
    rest.write_bytes(b"half a run")
    os.utime(rest, (0, 0))

    with serving(data_dir, NO_AUTH):
        assert not rest.exists()
