"""Full disk, clock jumps and exhausted memory: a named error or a retry, and no lost data."""

from __future__ import annotations

import resource
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from benchmarks.torture import pipeline
from benchmarks.torture.outcome import Outcome
from benchmarks.torture.watching import children
from tests.app import pretended
from tests.app.service import Caller, Server, run_text, serving

__all__ = ["ClockServer", "run"]

_PIPELINE = f"{pipeline.__name__}:identify"
_DISK = "24m"
_PATIENCE_S = 300.0
_YEAR_S = 365 * 86_400.0


class ClockServer(Server):
    """Server whose wall clock is shifted by the seconds in a file of its data directory."""

    command = (
        "import os, sys, time; real = time.time\n"
        "place = os.path.dirname(sys.argv[sys.argv.index('--data-dir') + 1]) + '/clock'\n"
        "time.time = lambda: real() + float(open(place).read() or 0)\n"
        "from app.cli import main; sys.exit(main())"
    )


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Exhaust each resource, then make it available again."""
    with (
        serving(directory / "data", "--no-auth", PIPELINE=_PIPELINE) as server,
        Caller(server) as caller,
    ):
        outcomes = [_forbidden_writes(server, caller), _memory(server, caller)]
    outcomes += _clocks(directory / "clocks", fits=3 if short else 12)
    if not short:
        outcomes.append(_full_disk(directory / "disk"))
    return outcomes


def _of(test: str, asked: str, faults: list[str], measured: str) -> Outcome:
    return Outcome(test, asked, "; ".join(faults) or measured, not faults)


def _ended(caller: Caller, run_id: str, seed: int) -> dict[str, Any]:
    """Fit of a run, after its end."""
    return caller.wait(caller.begin(run_id, seed=seed)["id"], seconds=_PATIENCE_S)


# ---------------------------------------------------------------- disk


def _forbidden_writes(server: Server, caller: Caller) -> Outcome:
    """Limit the size of files by the kernel, as on a full disk or an exhausted quota."""
    faults: list[str] = []
    run_id = caller.upload(run_text(0))["id"]
    with _largest_file(server, 1_000_000):
        large = caller.http.post("/runs", files={"file": ("a.csv", run_text(1, 30_000))})
        failed = _ended(caller, run_id, pipeline.LARGE)
        small = caller.http.post("/runs", files={"file": ("a.csv", run_text(2))})
    again = caller.http.post("/runs", files={"file": ("a.csv", run_text(1, 30_000))})
    fitted = _ended(caller, run_id, pipeline.LARGE)
    left = list(server.data_dir.rglob("incoming/*/*"))
    code = (failed["error"] or {}).get("code")
    if (large.status_code, large.json()["code"]) != (507, "storage_full"):
        faults.append(f"upload: {large.status_code} {large.text[:100]}")
    if (failed["status"], code) != ("failed", "storage_full"):
        faults.append(f"fit: {failed['status']} {failed['error']}")
    if (small.status_code, again.status_code, fitted["status"]) != (201, 201, "succeeded"):
        faults.append(f"after: {small.status_code} {again.status_code} {fitted['status']}")
    if left or caller.http.get(f"/runs/{run_id}").status_code != 200:
        faults.append(f"left behind: {left}")
    told = "upload 507 storage_full, fit failed as storage_full, both succeed once there is space"
    asked = "507 and a failure with a code, nothing lost, normal operation once there is space"
    return _of("no space for files", asked, faults, told)


@contextmanager
def _largest_file(server: Server, size: int) -> Iterator[None]:
    """Limit the size of files that a server and its children write, within a block."""
    pids = [server.process.pid, *children(server.process.pid)]
    for pid in pids:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    try:
        yield
    finally:
        for pid in pids:
            most = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, most)


def _full_disk(directory: Path) -> Outcome:
    """Fill a file system of a few megabytes that contains all data, including the database."""
    test, asked = "full disk", "507 or 503, nothing lost after acceptance"
    directory.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_DISK}", "tmpfs", str(directory)]
    if subprocess.run(mount, capture_output=True).returncode:
        return Outcome(test, asked, "not run: mounting needs root", True)
    try:
        faults, told = _fill(directory)
    finally:
        subprocess.run(["umount", "--lazy", str(directory)], check=True)
    return _of(test, asked, faults, told)


def _fill(directory: Path) -> tuple[list[str], str]:
    answers: set[tuple[int, str]] = set()
    with (
        serving(directory / "data", "--no-auth", PIPELINE=_PIPELINE) as server,
        Caller(server) as caller,
    ):
        runs = [caller.upload(run_text(seed))["id"] for seed in range(5)]
        fits = [caller.begin(run_id, seed=pipeline.BURNS)["id"] for run_id in runs[:2]]
        filler = directory / "filler"
        with filler.open("wb", buffering=0) as file:
            try:
                while file.write(b"x" * 4096):
                    pass
            except OSError:
                pass
        for seed in range(20):
            answer = caller.http.post("/runs", files={"file": ("a.csv", run_text(100 + seed))})
            answers.add((answer.status_code, str(answer.json().get("code"))))
            answer = caller.http.post("/fits", json={"training": [runs[0]], "options": {}})
            answers.add((answer.status_code, str(answer.json().get("code"))))
            if answer.status_code == 202:
                fits.append(answer.json()["id"])
        is_alive = httpx.get(f"{server.url}/healthz").status_code == 200
        filler.unlink()
        ends = {caller.wait(fit, seconds=_PATIENCE_S)["status"] for fit in fits}
        kept = {caller.http.get(f"/runs/{run_id}").status_code for run_id in runs}
        after = caller.http.post("/runs", files={"file": ("a.csv", run_text(500))}).status_code
    named = ("storage_full", "unavailable")
    faults = [f"{status} {code}" for status, code in answers if status >= 500 and code not in named]
    if not is_alive or kept != {200} or after != 201 or not ends <= {"succeeded", "failed"}:
        faults.append(f"alive {is_alive}, runs {kept}, after {after}, fits {ends}")
    told = ", ".join(f"{status} {code}" for status, code in sorted(answers))
    return faults, f"answers {told}; then {len(fits)} fits {'/'.join(sorted(ends))}, all runs kept"


# ---------------------------------------------------------------- memory


def _memory(server: Server, caller: Caller) -> Outcome:
    """Run a fit that requests memory until none is left."""
    run_id = caller.upload(run_text(0))["id"]
    once = _ended(caller, run_id, pipeline.HUNGRY_ONCE)
    always = _ended(caller, run_id, pipeline.HUNGRY)
    is_alive = httpx.get(f"{server.url}/readyz").status_code == 200
    error = always["error"] or {}
    faults = []
    if once["status"] != "succeeded":
        faults.append(f"once: {once['status']} {once['error']}")
    if always["status"] != "failed" or "memory" not in error.get("detail", "") or not is_alive:
        faults.append(f"always: {always['status']} {error}, alive {is_alive}")
    told = f"succeeded at attempt {once['attempt']}; failed as {error.get('code')}: "
    told += f"{error.get('detail')}"
    return _of(
        "no memory in the computing process", "retried, then failed with a reason", faults, told
    )


# ---------------------------------------------------------------- clock


def _clocks(directory: Path, fits: int) -> list[Outcome]:
    """Shift the wall clock by a year and back, in both directions, while fits wait and run."""
    directory.mkdir()
    (directory / "clock").write_text("0")
    settings = {"PIPELINE": "tests.app.pretended:identify", "RETENTION_DAYS": 30, "SWEEP_S": 1}
    server = ClockServer(directory / "data", "--no-auth", **settings)
    try:
        return [_clock(server, directory / "clock", jump, fits) for jump in (_YEAR_S, -_YEAR_S)]
    finally:
        server.stop()


def _clock(server: Server, clock: Path, jump: float, number: int) -> Outcome:
    with Caller(server) as caller:
        runs = [caller.upload(run_text(seed))["id"] for seed in range(number)]
        fits = [caller.begin(run_id, seed=pretended.SLOW)["id"] for run_id in runs]
        time.sleep(0.5)
        _write(clock, str(jump))
        time.sleep(2.5)
        _write(clock, "0")
        ended = [caller.wait(fit, seconds=_PATIENCE_S) for fit in fits]
        kept = {caller.http.get(f"/runs/{run_id}").status_code for run_id in runs}
    # A separate thread reads the log.
    time.sleep(0.5)
    log = "".join(server.log)
    results = [log.count(f'"fit succeeded", "fit": "{fit}"') for fit in fits]
    faults = []
    if {fit["status"] for fit in ended} != {"succeeded"} or kept != {200}:
        faults.append(f"fits {[fit['status'] for fit in ended]}, runs {kept}")
    if results != [1] * len(fits):
        faults.append(f"results of each fit: {results}")
    attempts = max(int(fit["attempt"]) for fit in ended)
    told = f"{number} fits, one result each, at most {attempts} attempts, nothing removed as old"
    return _of(
        f"wall clock shifted {'ahead' if jump > 0 else 'back'} by a year, then reset",
        "no fit lost, one result each, nothing removed",
        faults,
        told,
    )


def _write(file: Path, text: str) -> None:
    """Replace a file in one step, because it is read continuously."""
    new = file.with_suffix(".new")
    new.write_text(text)
    new.replace(file)
