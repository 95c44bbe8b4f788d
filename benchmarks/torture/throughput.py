"""Throughput: fits per minute with one worker per core, relative to one worker.

Each fit has one thread, so one worker uses one core.  Two servers take turns, one of them idle at a
time.  Each turn also runs the same fits without a service, because a second core rarely doubles the
speed of a machine.  A turn counts as quiet if other programs used almost no processor time
according to the kernel.  No turn begins before they are quiet or the time limit has passed.  The
result is the median of the quiet turns.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import tempfile
import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import Any

import httpx

from benchmarks.torture.outcome import Outcome
from benchmarks.torture.processes import machine_seconds, tree_seconds
from identification.ingest import read_run
from identification.options import FitOptions
from identification.pipeline import identify
from identification.threads import use_threads
from tests.app.service import ENDED, Caller, serving

__all__ = ["run"]

_RUN = Path("data/clean_servo/training_1.csv")
_LEAST = 0.85
_QUIET = 0.1
_LOOK_S = 0.25
_SILENCE_S = 3.0
_PATIENCE_S = 600.0


@dataclass(frozen=True)
class Kind:
    """Type of the fits.

    Args:
        name: Name in the table.
        options: Options of the fits.
        fits: Fits per worker in a turn.
        turns: Required number of quiet turns.
        seconds: Time after which no turn begins or waits for other programs [s].
    """

    name: str
    options: dict[str, Any]
    fits: int
    turns: int
    seconds: float


_BRIEF = {"posterior": False, "effects": False}
_LONG = (
    Kind("fits without effects and posterior", _BRIEF, fits=5, turns=9, seconds=900.0),
    Kind("fits with default options", {}, fits=2, turns=5, seconds=900.0),
)
_SHORT = (Kind("fits without effects and posterior", _BRIEF, fits=4, turns=3, seconds=20.0),)


@dataclass(frozen=True)
class Turn:
    """One comparison.

    Args:
        ratio: Ratio of fits per minute of several workers to one.
        bare: The same ratio of processes without a service.
        others: Cores used by other programs.
    """

    ratio: float
    bare: float
    others: float

    @property
    def is_quiet(self) -> bool:
        """True if other programs used almost no processor time."""
        return self.others <= _QUIET


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Measure the ratio in a few turns.

    Args:
        short: Whether to run the short version.
        directory: Directory of the data.
    """
    cores = len(os.sched_getaffinity(0))
    outcomes = []
    for number, kind in enumerate(_SHORT if short else _LONG):
        found: list[Turn] = []
        until = time.monotonic() + kind.seconds
        with closing(_turns(directory / str(number), cores, kind)) as measured:
            for turn in measured:
                found.append(turn)
                if sum(t.is_quiet for t in found) >= kind.turns or time.monotonic() > until:
                    break
        outcomes.append(_outcome(kind, cores, found))
    return outcomes


def _outcome(kind: Kind, cores: int, found: Sequence[Turn]) -> Outcome:
    quiet = [turn for turn in found if turn.is_quiet]
    counted = quiet or found
    ratios = [turn.ratio for turn in counted]
    bare = [turn.bare for turn in counted]
    middle = statistics.median(ratios)
    others = statistics.median(turn.others for turn in found)
    words = f"{len(quiet)} quiet turns of {len(found)}"
    if not quiet:
        words = f"{len(found)} turns, none of them quiet: others used {others:.1f} cores"
    return Outcome(
        test=f"throughput of {cores} workers relative to one, {kind.name}",
        asked=f"at least {_LEAST} x {cores} = {_LEAST * cores:.2f}",
        measured=f"{middle:.2f}, median of {words}, from {min(ratios):.2f} to {max(ratios):.2f}"
        f"; without a service {statistics.median(bare):.2f}",
        passed=middle >= _LEAST * cores,
    )


def _turns(directory: Path, workers: int, kind: Kind) -> Generator[Turn]:
    """Yield one comparison after another, of servers with one and with several workers."""
    settings = {"PIPELINE": "identification.pipeline:identify", "FIT_THREADS": 1}
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
            # A busy machine may respond slowly.
            caller.http.timeout = httpx.Timeout(_PATIENCE_S)
        runs = [caller.upload(_RUN.read_bytes(), _RUN.name)["id"] for caller in callers]
        for caller, stored in zip(callers, runs, strict=True):
            # Loading and compilation happen once and are not part of the rate.
            _rate(caller, stored, workers, kind.options)
        turn, until = 0, time.monotonic() + kind.seconds
        while True:
            turn += 1
            while time.monotonic() < until and _others() > _QUIET:
                pass
            before, own, began = machine_seconds(), tree_seconds(os.getpid()), time.monotonic()
            order = (0, 1) if turn % 2 else (1, 0)
            counts = (kind.fits, kind.fits * workers)
            rates = {n: _rate(callers[n], runs[n], counts[n], kind.options) for n in order}
            bare = _bare_ratio(workers, kind)
            used = machine_seconds() - before - (tree_seconds(os.getpid()) - own)
            yield Turn(rates[1] / rates[0], bare, used / (time.monotonic() - began))


def _others() -> float:
    """Number of cores used by other programs."""
    before = machine_seconds()
    time.sleep(_SILENCE_S)
    return (machine_seconds() - before) / _SILENCE_S


def _rate(caller: Caller, stored: str, count: int, options: dict[str, Any]) -> float:
    """Fits per second.

    Polling is rare because it takes processor time from the fits.
    """
    began = time.monotonic()
    fits = [caller.begin(stored, seed=9, **options)["id"] for _ in range(count)]
    for fit in reversed(fits):
        while caller.fit(fit)["status"] not in ENDED:
            time.sleep(_LOOK_S)
    seconds = time.monotonic() - began
    for fit in fits:
        end = caller.fit(fit)
        assert end["status"] == "succeeded", end["error"]
    return count / seconds


def _bare_ratio(workers: int, kind: Kind) -> float:
    """Speed-up of several processes without a service over one, for the same fits."""
    return _bare_rate(workers, kind) / _bare_rate(1, kind)


def _bare_rate(processes: int, kind: Kind) -> float:
    # As in the worker processes of the service.
    os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    context = multiprocessing.get_context("spawn")
    ready = context.Barrier(processes + 1)
    started = [context.Process(target=_bare, args=(ready, kind)) for _ in range(processes)]
    for process in started:
        process.start()
    ready.wait()
    began = time.monotonic()
    for process in started:
        process.join()
    return processes * kind.fits / (time.monotonic() - began)


def _bare(ready: Barrier, kind: Kind) -> None:
    use_threads(1)
    for number in range(kind.fits + 1):
        if number == 1:
            # Loading and compilation are done.
            ready.wait(_PATIENCE_S)
        run = read_run(_RUN)
        with tempfile.TemporaryDirectory() as directory:
            identify([run], options=FitOptions(**kind.options)).write(Path(directory))
