"""Fits a minute with as many workers as cores, over those with one, in one run.

Two servers run side by side, of which one is idle at a time; they take turns, so that whatever
else the machine does hits both alike, and the median of the ratios of the turns is what counts.
"""

from __future__ import annotations

import os
import statistics
import time
from contextlib import ExitStack
from pathlib import Path

import httpx

from benchmarks.torture.outcome import Outcome
from tests.app.service import Caller, serving

__all__ = ["ratios", "run"]

_RUN = Path("data/clean_servo/training_1.csv")
_LEAST = 0.85
_PATIENCE_S = 600.0


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Measure the ratio in a few turns.

    Args:
        short: Whether there is only a minute.
        directory: Where data go.
    """
    cores = len(os.sched_getaffinity(0))
    found = ratios(directory, cores, turns=3 if short else 9, fits=3 if short else 8)
    middle = statistics.median(found)
    return [
        Outcome(
            test=f"throughput of {cores} workers over that of one",
            asked=f"at least {_LEAST} x {cores} = {_LEAST * cores:.2f}",
            measured=f"{middle:.2f}, median of {len(found)} turns from {min(found):.2f} to "
            f"{max(found):.2f}",
            passed=middle >= _LEAST * cores,
        )
    ]


def ratios(directory: Path, workers: int, *, turns: int, fits: int) -> list[float]:
    """Fits a minute of several workers over those of one, turn by turn.

    Args:
        directory: Where data go.
        workers: How many workers are compared with one.
        turns: How often each is measured.
        fits: Fits of one worker in a turn; several get as many more.
    """
    settings = {"PIPELINE": "identification.pipeline:identify", "LOG_LEVEL": "warning"}
    found = []
    with ExitStack() as stack:
        callers = [
            stack.enter_context(
                Caller(
                    stack.enter_context(
                        serving(directory / str(n), "--no-auth", WORKERS=n, **settings)
                    )
                )
            )
            for n in (1, workers)
        ]
        for caller in callers:
            # A machine that is busy with other work may be slow to answer.
            caller.http.timeout = httpx.Timeout(_PATIENCE_S)
        runs = [caller.upload(_RUN.read_bytes(), _RUN.name)["id"] for caller in callers]
        for caller, stored in zip(callers, runs, strict=True):
            # What is loaded or compiled once is no part of the rate.
            _rate(caller, stored, workers)
        for turn in range(turns):
            order = (0, 1) if turn % 2 == 0 else (1, 0)
            rates = {n: _rate(callers[n], runs[n], fits * (1, workers)[n]) for n in order}
            found.append(rates[1] / rates[0])
    return found


def _rate(caller: Caller, stored: str, count: int) -> float:
    """Fits a second."""
    began = time.monotonic()
    fits = [caller.begin(stored, posterior=False, effects=False)["id"] for _ in range(count)]
    for fit in fits:
        end = caller.wait(fit, seconds=1800)
        assert end["status"] == "succeeded", end["error"]
    return count / (time.monotonic() - began)
