"""Repeated kills of a batch of many small motors, on this machine and on a service.

Signal 9 kills the command or the server at a random time after a random number of motors is done.
At the end, each motor must have one row, one fit and complete files.  At any time, the table must
be complete when it is read.  The short version has a mock pipeline in place of the real one.
"""

from __future__ import annotations

import csv
import io
import json
import os
import random
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from benchmarks.torture.fleet import write_fleet
from benchmarks.torture.outcome import Outcome
from motorid.client import Client
from tests.app.pretended import SLOW
from tests.app.service import PRETENDED

__all__ = ["run"]

_MOTORID = (sys.executable, "-c", "import sys; from app.cli import main; sys.exit(main())")
_QUICKLY = ("--no-posterior", "--no-effects", "--quiet")
_SEED = 4


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Kill batches repeatedly.

    Args:
        short: Whether to use a few motors and the mock pipeline instead of 200 and the real one.
        directory: Working directory.
    """
    motors, kills = (4, 2) if short else (200, 5)
    manifest = write_fleet(directory / "bench", motors, rows=120 if short else 200)
    chance = random.Random(_SEED)
    if short:
        head, *lines = manifest.read_text(encoding="utf-8").splitlines()
        lines = [f"{head},seed", *(f"{line},{SLOW}" for line in lines), ""]
        manifest.write_text("\n".join(lines), encoding="utf-8")
    with mock.patch.dict(os.environ, {"MOTORID_PIPELINE": PRETENDED} if short else {}):
        return [
            _here(manifest, directory / "here", motors, kills, chance),
            _at_a_service(manifest, directory / "there", motors, kills, chance),
        ]


class _Watch:
    """Observer that counts the faults of a running batch."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.looks = 0
        self.broken: list[str] = []

    def done(self) -> int:
        """Number of motors with a complete result; each call also reads the present table."""
        self.read_table()
        return len(list(self.out.glob("*/batch.json")))

    def read_table(self) -> None:
        try:
            text = (self.out / "results.csv").read_text(encoding="utf-8")
        except FileNotFoundError:
            return
        self.looks += 1
        lines = list(csv.reader(io.StringIO(text)))
        if not text.endswith("\n") or len({len(line) for line in lines}) > 1:
            self.broken.append(f"{len(text)} characters of a table")

    def faults(self, motors: int) -> list[str]:
        """Faults of a batch that has finished."""
        found = list(self.broken)
        with (self.out / "results.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        names = [row["motor"] for row in rows]
        if len(names) != motors or len(set(names)) != motors:
            found.append(f"{len(names)} rows for {len(set(names))} of {motors} motors")
        found += [f"{row['motor']} {row['status']}" for row in rows if row["status"] == "failed"]
        found += [f"{row['motor']} has no number" for row in rows if not row["Ra25"]]
        for name in names:
            json.loads((self.out / name / "result.json").read_text(encoding="utf-8"))
            if not (self.out / name / "report.html").read_text("utf-8").endswith("</html>"):
                found.append(f"{name} has half a report")
        # The history contains the first result of a motor that was fitted twice.
        found += [f"{path.parent.name} twice" for path in self.out.glob("*/history")]
        found += [f"{path.name} was left" for path in self.out.rglob("*.part")]
        return found


def _here(manifest: Path, out: Path, motors: int, kills: int, chance: random.Random) -> Outcome:
    watch = _Watch(out)
    began = time.monotonic()
    done = 0
    for threshold in sorted(chance.sample(range(max(motors - 1, kills)), kills)):
        with _command(manifest, out) as process:
            done = _kill_later(process, watch, threshold, chance)
    with _command(manifest, out) as process:
        status = _end_of(process, watch)
    faults = watch.faults(motors) + ([f"status {status}"] if status else [])
    return Outcome(
        f"`motorid batch` of {motors} motors, killed {kills} times",
        "finishes, one row per motor, no motor twice, no incomplete table",
        f"{motors - len(faults)} valid rows, last kill at {done} motors, table read {watch.looks} "
        f"times, {time.monotonic() - began:.0f} s" + _told(faults),
        not faults,
    )


def _at_a_service(
    manifest: Path, out: Path, motors: int, kills: int, chance: random.Random
) -> Outcome:
    watch = _Watch(out)
    began = time.monotonic()
    port = _free_port()
    url = f"http://127.0.0.1:{port}"
    data = out.with_name("data")
    server = _server(data, port)
    command = _command(manifest, out, url)
    victims = ["server", "command"] + [
        chance.choice(["server", "command"]) for _ in range(kills - 2)
    ]
    try:
        for threshold in sorted(chance.sample(range(max(motors - 1, kills)), kills)):
            victim = victims.pop()
            if victim == "server":
                _kill_later(server, watch, threshold, chance)
                server = _server(data, port)
            else:
                _kill_later(command, watch, threshold, chance)
                command = _command(manifest, out, url)
        status = _end_of(command, watch)
        faults = watch.faults(motors) + ([f"status {status}"] if status else [])
        faults += _faults_of_service(url, motors)
    finally:
        for process in (command, server):
            process.kill()
            process.wait()
    faults += _faults_of_database(data / "motorid.sqlite3")
    return Outcome(
        f"`motorid batch --server` of {motors} motors, command or server killed {kills} times",
        "finishes, one row per motor, one batch, no fit twice, no incomplete table",
        f"{motors - len(faults)} valid rows, table read {watch.looks} times, "
        f"{time.monotonic() - began:.0f} s" + _told(faults),
        not faults,
    )


def _faults_of_service(url: str, motors: int) -> list[str]:
    with Client(url) as service:
        batches = list(service.batches())
        states = [fit.status for fit in service.fits()]
    found = [] if len(batches) == 1 else [f"{len(batches)} batches"]
    if states != ["succeeded"] * motors:
        found.append(f"{len(states)} fits, {states.count('succeeded')} of them succeeded")
    return found


def _faults_of_database(path: Path) -> list[str]:
    connection = sqlite3.connect(path)
    try:
        (verdict,) = connection.execute("PRAGMA integrity_check").fetchone()
    finally:
        connection.close()
    return [] if verdict == "ok" else [f"database: {verdict}"]


def _command(manifest: Path, out: Path, url: str | None = None) -> subprocess.Popen[bytes]:
    words = ["batch", str(manifest), "--out", str(out), *_QUICKLY]
    return subprocess.Popen([*_MOTORID, *words, *(["--server", url] if url else [])])


def _server(data: Path, port: int) -> subprocess.Popen[bytes]:
    words = ["serve", "--no-auth", "--port", str(port), "--data-dir", str(data)]
    return subprocess.Popen(
        [*_MOTORID, *words],
        stderr=subprocess.DEVNULL,
        env=os.environ | {"MOTORID_LOG_LEVEL": "error"},
    )


def _kill_later(
    process: subprocess.Popen[bytes], watch: _Watch, threshold: int, chance: random.Random
) -> int:
    """Kill a process at a random time after `threshold` motors; return the number done."""
    _until(lambda: watch.done() >= threshold or process.poll() is not None)
    time.sleep(chance.uniform(0.0, 1.0))
    done = watch.done()
    process.kill()
    process.wait()
    return done


def _end_of(process: subprocess.Popen[bytes], watch: _Watch) -> int:
    _until(lambda: watch.done() < 0 or process.poll() is not None)
    return process.wait()


def _until(condition: Callable[[], bool], limit_s: float = 3600.0) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(f"not within {limit_s:g} s")
        time.sleep(0.05)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _told(faults: list[str]) -> str:
    return f"; {len(faults)} faults: {', '.join(faults[:5])}" if faults else ""
