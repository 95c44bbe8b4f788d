"""Mock pipeline whose behaviour is selected by the seed of a fit.

Computing processes import it by name in place of the real pipeline; see `MOTORID_PIPELINE`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import ComputationError, InputError
from identification.ingest import Run
from identification.options import FitOptions
from identification.posterior.checkpoint import Checkpoint

QUICK, SLOW, KILLED, BAD_INPUT, NO_SOLUTION, RAISES, ONCE_KILLED, FAMILY, SILENT, KEEPS, HELD = (
    range(11)
)
"""Seeds of a mock fit: QUICK succeeds at once; SLOW takes 2 s; KILLED is killed by a signal in
each attempt; BAD_INPUT and NO_SOLUTION raise an expected error; RAISES has a bug; ONCE_KILLED is
killed in its first attempt only; FAMILY starts a child process and does not end; SILENT ends
without a result; KEEPS counts its attempts in a checkpoint and is killed until the third, whose
result contains the count; HELD succeeds after `release`."""

_RELEASED = "released"


class Pretended:
    """Outcome of a mock fit."""

    def __init__(self, result: dict[str, Any], has_posterior: bool) -> None:
        self.result = result
        self.has_posterior = has_posterior

    def write(self, directory: Path) -> None:
        """Write small stand-ins for the outputs of a real fit."""
        (directory / "report.html").write_text("<!doctype html><title>Report</title><p>x</html>")
        if self.has_posterior:
            (directory / "posterior.nc").write_bytes(b"CDF\x02 pretended")
        (directory / "result.json").write_text(json.dumps(self.result))


def identify(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    progress: Callable[[str, float], None],
    checkpoint: Checkpoint | None = None,
) -> Pretended:
    """Behave as the seed requests; the result lists the inputs."""
    progress("fit", 0.0)
    kept = _keeps(checkpoint) if options.seed == KEEPS else 0
    _BEHAVIOURS[options.seed](progress, training[0])
    progress("report", 0.9)
    roles = [(run, "training") for run in training] + [(run, "validation") for run in validation]
    runs = [{"file": run.name, "sha256": run.sha256, "role": role} for run, role in roles]
    result = {
        "schema_version": 1,
        "runs": runs,
        "parameters": {"Ra25": _resistance(training)},
        "speeds": [float(run.speed[0]) for run, _ in roles],
        "temperatures": list(options.temperatures),
        "kept": kept,
    }
    return Pretended(result, options.posterior)


def _resistance(training: Sequence[Run]) -> dict[str, Any]:
    """Estimate that depends on the first run only, so that other runs give another value."""
    median = 1.0 + abs(float(training[0].speed[0]))
    return {
        "mean": median,
        "sd": 0.01,
        "q05": median - 0.016,
        "median": median,
        "q95": median + 0.016,
        "unit": "ohm",
        "identified": True,
    }


def _quick(progress: Callable[[str, float], None], run: Run) -> None:
    pass


def _slow(progress: Callable[[str, float], None], run: Run) -> None:
    for step in range(30):
        progress("posterior", step / 30)
        time.sleep(0.065)


def _killed(progress: Callable[[str, float], None], run: Run) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _bad_input(progress: Callable[[str, float], None], run: Run) -> None:
    raise InputError("the speed never moves", file=run.name, row=7, column="speed_rad_s")


def _no_solution(progress: Callable[[str, float], None], run: Run) -> None:
    raise ComputationError("no step made the error smaller")


def _raises(progress: Callable[[str, float], None], run: Run) -> None:
    raise RuntimeError("a bug")


def _once_killed(progress: Callable[[str, float], None], run: Run) -> None:
    # The temporary directory is that of the attempt, named by the attempt number.
    if Path(os.environ["TMPDIR"]).name == "1":
        os.kill(os.getpid(), signal.SIGKILL)


def _family(progress: Callable[[str, float], None], run: Run) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    (Path(os.environ["TMPDIR"]) / "pids").write_text(f"{os.getpid()} {child.pid}")
    time.sleep(600)


def _held(progress: Callable[[str, float], None], run: Run) -> None:
    while not (Path(os.environ["TMPDIR"]) / _RELEASED).exists():
        time.sleep(0.02)


def release(data_dir: Path, fit_id: str) -> None:
    """Let a HELD fit succeed in its first attempt, once it runs."""
    directory = data_dir / "fits" / fit_id / "1"
    deadline = time.monotonic() + 60.0
    while not directory.exists():
        assert time.monotonic() < deadline, "the fit does not run"
        time.sleep(0.02)
    (directory / _RELEASED).touch()


def _silent(progress: Callable[[str, float], None], run: Run) -> None:
    os._exit(0)


def _keeps(checkpoint: Checkpoint | None) -> int:
    assert checkpoint is not None
    mine = checkpoint.about("pretended")
    state = mine.load("count")
    count = 0 if state is None else int(state["count"])
    if count < 2:
        mine.save("count", {"count": np.array(count + 1)})
        os.kill(os.getpid(), signal.SIGKILL)
    return count


_BEHAVIOURS: dict[int, Callable[[Callable[[str, float], None], Run], None]] = {
    QUICK: _quick,
    SLOW: _slow,
    KILLED: _killed,
    BAD_INPUT: _bad_input,
    NO_SOLUTION: _no_solution,
    RAISES: _raises,
    ONCE_KILLED: _once_killed,
    FAMILY: _family,
    SILENT: _silent,
    KEEPS: _quick,
    HELD: _held,
}
