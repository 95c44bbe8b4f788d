"""Fuzzing of the fit with random and absurd campaigns.

    python -m benchmarks.fuzz_fits [--fits 2000] [--first 0] [--minutes 600] [--slow 60]
    python -m benchmarks.fuzz_fits --only SEED

Each campaign of `benchmarks.absurd_runs` goes through `identification.identify`; its result is
written, validated against the schema, predicts each of its runs and is evaluated in a closed loop.
`InputError`, `ComputationError` and their subclasses are valid outcomes.  Any other exception is an
internal error and is reported with its seed and source location; `--only` repeats it with the
traceback.  The exit status is 1 after an internal error.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema

from app.commands.files import read_result, write_json
from app.commands.motor import motor_of
from benchmarks.absurd_runs import Case, drawn
from identification import identify, predict
from identification.errors import IdentificationError
from identification.result.schema import result_schema
from identification.speed_loop import feedback_metrics
from identification.threads import use_threads

__all__ = ["Ending", "ending_of", "main"]

_TOLD = 50
"""Number of fits between two printed counts."""
_DRAWS = 50
"""Draws for the repeated evaluation of the loop from the written result."""


@dataclass(frozen=True)
class Ending:
    """Outcome of one fit.

    Args:
        seed: Seed of the campaign.
        words: Description of the campaign on one line.
        kind: ``result``, the name of an expected error, or ``internal``.
        message: Message of the error; with the source location if it is internal.
        warned: Source locations of Python warnings, which users would see on standard error.
        seconds: Wall clock [s].
    """

    seed: int
    words: str
    kind: str
    message: str
    warned: tuple[str, ...]
    seconds: float


def ending_of(case: Case, show_traceback: bool = False) -> Ending:
    """Fit, write, predict and evaluate one campaign.

    Args:
        case: The campaign.
        show_traceback: Whether the traceback of an internal error is printed.
    """
    began = time.perf_counter()
    kind, message = "result", ""
    with warnings.catch_warnings(record=True) as seen, tempfile.TemporaryDirectory() as directory:
        warnings.simplefilter("always")
        try:
            _use(case, Path(directory))
        except IdentificationError as error:
            kind, message = type(error).__name__, str(error)
        except Exception as error:  # noqa: BLE001  any exception is a finding
            kind, message = "internal", _located(error)
            if show_traceback:
                traceback.print_exc()
    warned = tuple(sorted({f"{w.filename}:{w.lineno} {w.message}" for w in seen}))
    return Ending(case.seed, case.words, kind, message, warned, time.perf_counter() - began)


def _use(case: Case, directory: Path) -> None:
    identify(case.training, case.validation, case.options).write(directory)
    path = directory / "result.json"
    result: dict[str, Any] = read_result(path)
    jsonschema.validate(result, result_schema())
    json.loads(path.read_text("utf-8"), parse_constant=_refused)
    if not (directory / "report.html").read_text("utf-8").rstrip().endswith("</html>"):
        raise ValueError("report.html is not complete")
    for run in (*case.training, *case.validation):
        for declared in (False, True):
            _answered(partial(predict, result, run, declared))
    _answered(partial(_evaluated, path, case.options.controllers))


def _evaluated(path: Path, controllers: Sequence[str]) -> None:
    """Evaluate the closed loop of a result as ``motorid feedback`` does."""
    with contextlib.redirect_stderr(io.StringIO()):
        motor, _ = motor_of(path, (), _DRAWS)
    entries = feedback_metrics(motor, (25.0, 125.0), controllers)
    write_json(path.with_name("feedback.json"), entries, path)


def _refused(word: str) -> None:
    raise ValueError(f"result.json holds {word}")


def _answered(call: Callable[[], object]) -> None:
    """Make a call and ignore its expected errors, so that the next calls are tried as well."""
    try:
        call()
    except IdentificationError as error:
        if not str(error):
            raise ValueError(f"{type(error).__name__} without a message") from error


def _located(error: Exception) -> str:
    """Type, message and innermost source location in the project."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        f for f in frames if "site-packages" not in f.filename and "benchmarks" not in f.filename
    ]
    at = (own or frames)[-1]
    return f"{type(error).__name__} at {_short(at.filename)}:{at.lineno} in {at.name}: {error}"


def _short(file: str) -> str:
    return os.path.relpath(file, Path(__file__).parents[1])


def _ending_of_seed(seed: int, rows: int, effects: float, posterior: float) -> Ending:
    use_threads(1)
    return ending_of(drawn(seed, rows, effects, posterior))


def _endings(chosen: argparse.Namespace) -> Iterator[Ending]:
    """Yield outcomes as they arrive; start no fit after the time limit."""
    until = time.monotonic() + 60.0 * chosen.minutes
    left = iter(range(chosen.first, chosen.first + chosen.fits))
    jobs: set[Future[Ending]] = set()
    with ProcessPoolExecutor(chosen.processes) as pool:
        while True:
            while len(jobs) < 2 * chosen.processes and time.monotonic() < until:
                seed = next(left, None)
                if seed is None:
                    break
                numbers = (chosen.rows, chosen.effects, chosen.posterior)
                jobs.add(pool.submit(_ending_of_seed, seed, *numbers))
            if not jobs:
                return
            done, jobs = wait(jobs, return_when=FIRST_COMPLETED)
            yield from (job.result() for job in done)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit the campaigns and print internal errors, warnings and slow fits."""
    chosen = _arguments(arguments)
    if chosen.only is not None:
        use_threads(1)
        case = drawn(chosen.only, chosen.rows, chosen.effects, chosen.posterior)
        print(f"{case.seed}: {case.words}")
        ending = ending_of(case, show_traceback=True)
        print(f"{ending.seconds:.1f} s, {ending.kind}: {ending.message}", *ending.warned, sep="\n")
        return int(ending.kind == "internal")
    kinds: Counter[str] = Counter()
    warned: Counter[str] = Counter()
    slow: list[Ending] = []
    for ending in _endings(chosen):
        kinds[ending.kind] += 1
        warned.update(ending.warned)
        if ending.kind == "internal":
            print(
                f"internal error, --only {ending.seed} --rows {chosen.rows} --effects "
                f"{chosen.effects:g} --posterior {chosen.posterior:g}: {ending.message} "
                f"[{ending.words}]",
                flush=True,
            )
        if kinds.total() % _TOLD == 0:
            print(f"{kinds.total()} fits: {dict(kinds.most_common())}", flush=True)
        if ending.seconds > chosen.slow:
            slow.append(ending)
            print(f"{ending.seconds:.0f} s, --only {ending.seed} [{ending.words}]", flush=True)
    print(f"{kinds.total()} fits: {dict(kinds.most_common())}; {len(slow)} over {chosen.slow:g} s")
    for place, count in warned.most_common():
        print(f"warning in {count} fits: {place}")
    return int(kinds["internal"] > 0)


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fits", type=int, default=2000, help="number of campaigns")
    parser.add_argument("--first", type=int, default=0, help="seed of the first campaign")
    parser.add_argument(
        "--only", type=int, metavar="SEED", help="repeat one campaign with its traceback"
    )
    parser.add_argument("--rows", type=int, default=500, help="maximum number of samples of a run")
    parser.add_argument(
        "--effects", type=float, default=0.05, help="fraction with a search for effects"
    )
    parser.add_argument("--posterior", type=float, default=0.01, help="fraction with sampling")
    parser.add_argument(
        "--minutes", type=float, default=600.0, help="time limit for new fits [min]"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--slow", type=float, default=60.0, help="time above which a fit is reported [s]"
    )
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
