"""Random kills of all processes of a service while clients submit fits.

Signal 9 kills the server, the fork server, the computing processes, and the scheduler and the
workers of a cluster.  PostgreSQL is stopped as by a crash, or one of its processes is killed.
Afterwards each accepted fit must have ended once, with its own result, and no process or file may
be left over.
"""

from __future__ import annotations

import collections
import random
import re
import sqlite3
import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import psycopg

from benchmarks.torture import processes
from benchmarks.torture.clients import Client
from benchmarks.torture.outcome import Outcome
from benchmarks.torture.rig import COMBINATIONS, Rig
from tests.app.postgresql import MISSING
from tests.app.pretended import FAMILY
from tests.app.service import Caller, run_text

__all__ = ["cancelled", "resumed", "run", "torture"]

_CAMPAIGN = Path("data/clean_servo")
_REAL = "identification.pipeline:identify"
_PIPELINE = "benchmarks.torture.pretended:identify"
_CLIENTS = 2
_PATIENCE_S = 180.0
_CONSISTENT = """
    SELECT count(*) FROM fits WHERE status IN ('queued', 'running') OR ended_at IS NULL
        OR owner IS NOT NULL OR lease_until IS NOT NULL OR attempt < 1
"""
_UNOWNED = "SELECT count(*) FROM fit_runs WHERE fit_id NOT IN (SELECT id FROM fits)"
_FITS = "SELECT count(*), count(DISTINCT idempotency_key) FROM fits"


def run(*, short: bool, directory: Path) -> Iterator[Outcome]:
    """Kill 200 times over both databases and both engines, or a few times over two.

    Args:
        short: Whether to run the short version.
        directory: Directory of the data.
    """
    chosen = [pair for pair in COMBINATIONS if pair[0] == "sqlite" or MISSING is None]
    if short:
        chosen = [chosen[0], chosen[-1]]
    kills = 6 if short else -(-200 // len(chosen))
    for number, (database, engine) in enumerate(chosen):
        part = directory / f"{database}-{engine}"
        part.mkdir()
        yield torture(part, database, engine, kills, random.Random(number))
    for engine in ("local", "dask"):
        yield cancelled(directory / f"cancel-{engine}", engine, 3 if short else 30)
    if not short:
        yield resumed(directory / "resumed")


def cancelled(directory: Path, engine: str, count: int) -> Outcome:
    """Time from cancelling a fit to the end of all its processes.

    Args:
        directory: Directory of the data.
        engine: ``local`` or ``dask``.
        count: Number of fits.
    """
    took = []
    with (
        Rig.running(directory, database="sqlite", engine=engine, WORKERS=2) as rig,
        Caller(rig.server) as caller,
    ):
        run = caller.upload(run_text(1))["id"]
        for _ in range(count):
            fit = caller.begin(run, seed=FAMILY)["id"]
            pids = rig.data_dir / "fits" / fit / "1" / "pids"
            while not pids.exists() or len(pids.read_text().split()) < 2:
                time.sleep(0.005)
            family = [int(pid) for pid in pids.read_text().split()]
            began = time.monotonic()
            caller.http.delete(f"/fits/{fit}")
            while any(map(processes.is_running, family)) and time.monotonic() < began + 10:
                time.sleep(0.001)
            took.append(time.monotonic() - began)
    return Outcome(
        test=f"cancelling a running fit, engine {engine}",
        asked="its process and all child processes end within 1 s",
        measured=f"{count} times: median {statistics.median(took) * 1e3:.0f} ms, longest "
        f"{max(took) * 1e3:.0f} ms",
        passed=max(took) < 1.0,
    )


def resumed(directory: Path) -> Outcome:
    """Kill a real fit while it samples in two attempts; compare it with an undisturbed fit.

    Args:
        directory: Directory of the data.
    """
    settings = {"PIPELINE": _REAL, "WORKERS": 1, "CHECKPOINT_S": 0, "LOG_LEVEL": "info"}
    kept: list[bool] = []
    with Rig.running(directory, database="sqlite", engine="local", **settings) as rig:
        with Caller(rig.server) as caller:
            run = caller.upload((_CAMPAIGN / "training_1.csv").read_bytes(), "training_1.csv")["id"]
            alone = caller.wait(caller.begin(run, effects=False)["id"], seconds=1800)
            fit = caller.begin(run, effects=False)["id"]
            for attempt in (1, 2):
                file = rig.data_dir / "fits" / fit / "checkpoints" / f"{attempt}.npz"
                while not file.exists() and caller.fit(fit)["status"] in ("queued", "running"):
                    time.sleep(0.01)
                kept.append(file.exists())
                rig.kill("child", random.Random(attempt))
            end = caller.wait(fit, seconds=1800)
    parts = ("parameters", "sampler", "feedback")
    same = [name for name in parts if end["result"][name] == alone["result"][name]]
    return Outcome(
        test="a real fit, killed twice during sampling",
        asked="continues from its checkpoint to the result of an uninterrupted fit",
        measured=f"{end['status']} in attempt {end['attempt']}; equal: {', '.join(same)}",
        passed=all(kept) and end["attempt"] == 3 and len(same) == len(parts),
    )


def torture(directory: Path, database: str, engine: str, kills: int, rng: random.Random) -> Outcome:
    """Kill processes repeatedly and check the final state.

    Args:
        directory: Directory of the data.
        database: ``sqlite`` or ``postgresql``.
        engine: ``local`` or ``dask``.
        kills: Number of kills.
        rng: Determines target and time of each kill.
    """
    began = time.monotonic()
    settings = {"PIPELINE": _PIPELINE, "WORKERS": 4, "MAX_ATTEMPTS": 100}
    with Rig.running(directory, database=database, engine=engine, **settings) as rig:
        clients = [Client(lambda: rig.url, number) for number in range(_CLIENTS)]
        for client in clients:
            client.start()
        killed = _kill(rig, clients, kills, rng)
        for client in clients:
            client.stop()
        deadline = time.monotonic() + _PATIENCE_S
        while any(client.is_busy for client in clients) and time.monotonic() < deadline:
            _tend(rig)
        faults = [fault for client in clients for fault in _faults_of(client, rig)]
        rig.stop()
        faults += _faults_in_database(rig, sum(len(client.accepted) for client in clients))
        faults += _doubles(rig.log)
    left = _left_over(rig)
    faults += [f"{len(left)} processes left over"] if left else []
    return _outcome(database, engine, killed, clients, faults, time.monotonic() - began)


def _outcome(
    database: str,
    engine: str,
    killed: collections.Counter[str],
    clients: list[Client],
    faults: list[str],
    seconds: float,
) -> Outcome:
    fits = sum(len(client.accepted) for client in clients)
    attempts = sum(fit["attempt"] for client in clients for fit in client.ended.values())
    names = ", ".join(f"{name} {count}" for name, count in sorted(killed.items()))
    measured = (
        f"{killed.total()} kills ({names}) in {seconds:.0f} s; {fits} fits accepted in "
        f"{attempts} attempts; "
    )
    return Outcome(
        test=f"random kill -9, {database}, engine {engine}",
        asked="each accepted fit succeeds once, one result each, database consistent, no orphan",
        measured=measured + ("; ".join(faults[:5]) if faults else "no fit lost, no result twice"),
        passed=not faults and fits > 0,
    )


def _kill(
    rig: Rig, clients: list[Client], kills: int, rng: random.Random
) -> collections.Counter[str]:
    """Kill each target in turn, in random order.

    Half of the kills follow the previous one immediately and hit a starting process.  The others
    follow the end of a fit, so that fits end even on a slow machine.
    """
    killed: collections.Counter[str] = collections.Counter()
    bag: list[str] = []
    while killed.total() < kills:
        if not bag:
            bag = rig.targets()
            rng.shuffle(bag)
        if rng.random() < 0.5:
            _await_an_end(rig, clients)
        time.sleep(rng.uniform(0.1, 1.2))
        _tend(rig)
        target = bag.pop()
        killed[target] += rig.kill(target, rng)
    return killed


def _await_an_end(rig: Rig, clients: list[Client]) -> None:
    before = sum(len(client.ended) for client in clients)
    deadline = time.monotonic() + _PATIENCE_S
    while sum(len(client.ended) for client in clients) == before and time.monotonic() < deadline:
        _tend(rig)


def _tend(rig: Rig) -> None:
    """Restart workers, which end when their scheduler is killed."""
    if rig.cluster is not None:
        rig.cluster.tend()
    time.sleep(0.05)


def _faults_of(client: Client, rig: Rig) -> list[str]:
    faults = list(client.unexpected)
    faults += [f"{fit} never ended" for fit in client.accepted.keys() - client.ended.keys()]
    if len(client.accepted) > len(client.ended):
        return faults
    faults += [f"{fit} changed after its end" for fit in client.changed()]
    for fit, seed in client.accepted.items():
        end = client.ended[fit]
        if end["status"] != "succeeded" or end["result"]["seed"] != seed:
            faults.append(f"{fit} is {end['status']}: {end['error']}")
        kept = sorted(path.name for path in (rig.data_dir / "fits" / fit).iterdir())
        if kept != [str(end["attempt"])]:
            faults.append(f"{fit} has left {kept}")
    return faults


def _faults_in_database(rig: Rig, accepted: int) -> list[str]:
    faults = []
    if rig.postgres is None:
        connection = sqlite3.connect(rig.data_dir / "motorid.sqlite3")
        said = connection.execute("PRAGMA integrity_check").fetchall()
        faults += [f"integrity_check: {said}"] if said != [("ok",)] else []
        said = connection.execute("PRAGMA foreign_key_check").fetchall()
        faults += [f"foreign_key_check: {said}"] if said else []
        found = [connection.execute(query).fetchone() for query in (_CONSISTENT, _UNOWNED, _FITS)]
        connection.close()
    else:
        with psycopg.connect(str(rig.settings["DATABASE_URL"])) as server:
            queries = [query.encode() for query in (_CONSISTENT, _UNOWNED, _FITS)]
            found = [server.execute(query).fetchone() for query in queries]
    expected = [(0,), (0,), (accepted, accepted)]
    return faults + ([f"rows: {found}, expected {expected}"] if found != expected else [])


def _doubles(log: list[str]) -> list[str]:
    """Fits that were logged as succeeded more than once."""
    told = collections.Counter(
        found.group(1)
        for line in log
        if '"fit succeeded"' in line and (found := re.search(r'"fit": "(\w+)"', line))
    )
    return [f"{fit} succeeded {count} times" for fit, count in told.items() if count > 1]


def _left_over(rig: Rig) -> list[int]:
    """Processes that survive the longest loading time of libraries."""
    deadline = time.monotonic() + 20
    while (left := rig.left_over()) and time.monotonic() < deadline:
        time.sleep(0.1)
    return left
