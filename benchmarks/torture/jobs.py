"""Hostile jobs in parallel with a normal client: huge mappings, many runs, long names, kills.

One client sends jobs that are large or kill their process.  Another client, in its own workspace,
runs fits of two seconds in sequence; each of them must end in its first attempt and in its usual
time.  Afterwards the fork server is killed repeatedly.
"""

from __future__ import annotations

import json
import statistics
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.torture import processes
from benchmarks.torture.outcome import Outcome
from tests.app.pretended import BAD_INPUT, KILLED, QUICK, RAISES, SILENT, SLOW
from tests.app.service import ENDED, Caller, make_key, run_text, serving

__all__ = ["run"]

_PATIENCE_S = 30.0
_LONGER = 2.0
_SOUND = ("succeeded", 1)
_SEEDS = (QUICK, KILLED, RAISES, SILENT, BAD_INPUT)


@dataclass
class _Seen:
    """Outcomes of the calls and fits of the hostile client."""

    uploads: Counter[int] = field(default_factory=Counter)
    fits: Counter[str] = field(default_factory=Counter)


def run(*, short: bool, directory: Path) -> Iterator[Outcome]:
    """Send the hostile jobs, then kill the fork server."""
    keys = [make_key(directory / "data", name) for name in ("hostile", "normal")]
    with (
        serving(directory / "data", WORKERS=2) as server,
        Caller(server, keys[0]) as hostile,
        Caller(server, keys[1]) as normal,
    ):
        run_id = normal.upload(run_text(1))["id"]
        alone = [_fit(normal, run_id)[0] for _ in range(2 if short else 5)]
        # One for each kind of columns and each way to end.
        fits = 5 if short else 30
        beside, seen = _beside(hostile, normal, run_id, fits=fits, runs=4 if short else 200)
        yield _outcome(fits, alone, beside, seen)
        yield _kills(server.process.pid, normal, run_id, 2 if short else 12)


def _fit(caller: Caller, run_id: str) -> tuple[float, str, int]:
    """Time from the call to the end [s], status and attempts of a normal fit."""
    began = time.monotonic()
    fit = caller.begin(run_id, seed=SLOW)
    deadline = began + _PATIENCE_S
    while (fit := caller.fit(fit["id"]))["status"] not in ENDED and time.monotonic() < deadline:
        time.sleep(0.05)
    return time.monotonic() - began, str(fit["status"]), int(fit["attempt"])


def _beside(
    hostile: Caller, normal: Caller, run_id: str, *, fits: int, runs: int
) -> tuple[list[tuple[float, str, int]], _Seen]:
    """Fits of the normal client while the hostile client is active."""
    seen = _Seen()
    work = threading.Thread(target=_attack, args=(hostile, fits, runs, seen))
    work.start()
    beside = []
    while work.is_alive():
        beside.append(_fit(normal, run_id))
    work.join()
    return beside, seen


def _attack(caller: Caller, fits: int, runs: int, seen: _Seen) -> None:
    """Upload runs of each type, then request fits of them in sequence."""
    large = min(runs, 25)
    kinds = [
        _uploaded(caller, seen, "s" * 9_000, runs=large),
        _uploaded(caller, seen, "ä" * 4_500, runs=large),
        _uploaded(caller, seen, "s" * 66_000, runs=3),
        _uploaded(caller, seen, "ä" * 33_000, runs=3),
        _uploaded(caller, seen, "n_ist", runs=2 * runs),
    ]
    kinds = [kind for kind in kinds if kind]
    for number in range(fits):
        ids = kinds[number % len(kinds)]
        half = max(1, len(ids) // 2)
        body = {
            "training": ids[:half],
            "validation": ids[half:],
            "options": {"seed": _SEEDS[number % len(_SEEDS)]},
            "motor": "ä" * 200,
        }
        answer = caller.http.post("/fits", json=body)
        status = _end(caller, answer.json()["id"]) if answer.status_code == 202 else "refused"
        seen.fits[status] += 1
    too_many = {"training": ["run_a"] * 201}
    seen.fits[str(caller.http.post("/fits", json=too_many).status_code)] += 1


def _uploaded(caller: Caller, seen: _Seen, column: str, *, runs: int) -> list[str]:
    """Upload runs whose speed column has the given name; return their ids."""
    mapping = {"speed_rad_s": {"column": column, "unit": "rad/s"}}
    ids = []
    for seed in range(runs):
        text = run_text(seed + len(column)).decode().replace("speed_rad_s", column)
        answer = caller.http.post(
            "/runs",
            files={"file": ("ä" * 300, text.encode())},
            data={"mapping": json.dumps(mapping, ensure_ascii=False)},
        )
        seen.uploads[answer.status_code] += 1
        if answer.status_code in (200, 201):
            ids.append(answer.json()["id"])
    return ids


def _end(caller: Caller, fit_id: str) -> str:
    """Status of a fit at its end, or after 30 s."""
    deadline = time.monotonic() + _PATIENCE_S
    while (status := str(caller.fit(fit_id)["status"])) not in ENDED:
        if time.monotonic() > deadline:
            return f"still {status}"
        time.sleep(0.05)
    return status


def _outcome(
    fits: int, alone: list[float], beside: list[tuple[float, str, int]], seen: _Seen
) -> Outcome:
    usual, slowest = statistics.median(alone), max(seconds for seconds, _, _ in beside)
    faults = [f"{s} in attempt {n} after {t:.0f} s" for t, s, n in beside if (s, n) != _SOUND]
    faults += [f"uploads {seen.uploads}"] if set(seen.uploads) - {200, 201, 422} else []
    faults += [f"fits {seen.fits}"] if set(seen.fits) - {"succeeded", "failed", "422"} else []
    faults += [f"took {slowest:.1f} s"] if slowest > _LONGER * usual else []
    measured = (
        f"{len(beside)} normal fits in their first attempts, {usual:.1f} s alone and at most "
        f"{slowest:.1f} s in parallel; hostile uploads {dict(sorted(seen.uploads.items()))}, fits "
        f"{dict(sorted(seen.fits.items()))}"
    )
    return Outcome(
        f"{fits} hostile jobs in parallel with a normal client",
        f"normal fits take at most {_LONGER:g} times their usual time; hostile fits end",
        "; ".join(faults[:5]) or measured,
        not faults,
    )


def _kills(server: int, caller: Caller, run_id: str, kills: int) -> Outcome:
    """Kill the fork server while a fit runs; the fit is requeued and restarted."""
    fit = caller.begin(run_id, seed=SLOW)["id"]
    killed = 0
    deadline = time.monotonic() + kills * _PATIENCE_S
    while killed < kills and time.monotonic() < deadline:
        found = processes.fork_servers(server)
        if not found or not processes.children(found[0]):
            time.sleep(0.02)
            continue
        killed += processes.kill(found[0])
        while processes.is_running(found[0]):
            time.sleep(0.01)
    end = caller.wait(fit, *ENDED, seconds=2 * _PATIENCE_S + 60)
    return Outcome(
        f"{kills} kills of the fork server during one fit",
        "the fit succeeds, because these kills do not count as its failures",
        f"{killed} kills; {end['status']} in attempt {end['attempt']}",
        (killed, end["status"]) == (kills, "succeeded"),
    )
