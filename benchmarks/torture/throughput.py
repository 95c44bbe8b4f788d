"""Fits a minute with as many workers as cores, over those with one, in one run.

Two servers run side by side, of which one is idle at a time; they take turns, so that whatever
else the machine does hits both alike, and the median of the ratios of the turns is what counts.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import tempfile
import time
from contextlib import ExitStack
from multiprocessing.synchronize import Barrier
from pathlib import Path

import httpx

from benchmarks.torture.outcome import Outcome
from identification.ingest import read_run
from identification.options import FitOptions
from identification.pipeline import identify
from tests.app.service import ENDED, Caller, serving

__all__ = ["bare_ratio", "ratios", "run"]

_RUN = Path("data/clean_servo/training_1.csv")
_LEAST = 0.85
_LOOK_S = 0.25
_PATIENCE_S = 600.0


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Measure the ratio in a few turns.

    Args:
        short: Whether there is only a minute.
        directory: Where data go.
    """
    cores = len(os.sched_getaffinity(0))
    turns, fits = (3, 4) if short else (9, 10)
    found = ratios(directory, cores, turns=turns, fits=fits)
    middle = statistics.median(found)
    bare = statistics.median(bare_ratio(cores, fits) for _ in range(1 if short else 5))
    return [
        Outcome(
            test=f"throughput of {cores} workers over that of one",
            asked=f"at least {_LEAST} x {cores} = {_LEAST * cores:.2f}",
            measured=f"{middle:.2f}, median of {len(found)} turns from {min(found):.2f} to "
            f"{max(found):.2f}; processes without a service gain {bare:.2f}",
            passed=middle >= _LEAST * cores,
        )
    ]


def ratios(
    directory: Path, workers: int, *, turns: int, fits: int, **settings: object
) -> list[float]:
    """Fits a minute of several workers over those of one, turn by turn.

    Args:
        directory: Where data go.
        workers: How many workers are compared with one.
        turns: How often each is measured.
        fits: Fits of one worker in a turn; several get as many more.
        **settings: Settings of the servers, such as another pipeline.
    """
    settings = {"PIPELINE": "identification.pipeline:identify"} | settings
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
            _rate(caller, stored, workers, seed=0)
        for turn in range(turns):
            order = (0, 1) if turn % 2 == 0 else (1, 0)
            rates = {n: _rate(callers[n], runs[n], fits * (1, workers)[n]) for n in order}
            found.append(rates[1] / rates[0])
    return found


def _rate(caller: Caller, stored: str, count: int, seed: int = 9) -> float:
    """Fits a second.

    Looked for seldom, since who asks takes time from those who compute.
    """
    began = time.monotonic()
    options = {"seed": seed, "posterior": False, "effects": False}
    fits = [caller.begin(stored, **options)["id"] for _ in range(count)]
    for fit in reversed(fits):
        while caller.fit(fit)["status"] not in ENDED:
            time.sleep(_LOOK_S)
    seconds = time.monotonic() - began
    for fit in fits:
        end = caller.fit(fit)
        assert end["status"] == "succeeded", end["error"]
    return count / seconds


def bare_ratio(workers: int, fits: int) -> float:
    """What the machine itself gains from several processes that compute the same, without us.

    Args:
        workers: How many processes.
        fits: Fits of each.
    """
    return _bare_rate(workers, fits) / _bare_rate(1, fits)


def _bare_rate(processes: int, fits: int) -> float:
    # As the service's own have it.
    os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    context = multiprocessing.get_context("spawn")
    ready = context.Barrier(processes + 1)
    started = [context.Process(target=_bare, args=(ready, fits)) for _ in range(processes)]
    for process in started:
        process.start()
    ready.wait()
    began = time.monotonic()
    for process in started:
        process.join()
    return processes * fits / (time.monotonic() - began)


def _bare(ready: Barrier, fits: int) -> None:
    for number in range(fits + 1):
        if number == 1:
            # What is loaded or compiled once is behind it.
            ready.wait()
        run = read_run(_RUN)
        with tempfile.TemporaryDirectory() as directory:
            options = FitOptions(posterior=False, effects=False)
            identify([run], options=options).write(Path(directory))
