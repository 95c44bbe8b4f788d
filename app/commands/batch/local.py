"""Batch identification on this machine: one process per motor, a fixed number in parallel."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from app.commands.arguments import run_names
from app.commands.batch.manifest import Motor
from app.fits.job import FitJob, RunFile
from app.fork_server.client import ForkServer, Task
from identification.threads import cores

__all__ = ["MotorJob", "fit_all"]

_WAIT_S = 0.02
_MOST_LOSSES = 3
_PIPELINE = "identification.pipeline:identify"


@dataclass(frozen=True)
class MotorJob:
    """A motor to be fitted."""

    motor: Motor
    record: dict[str, Any]
    """Inputs that determine the result."""
    out: Path


def fit_all(
    jobs: Sequence[MotorJob], at_once: int, tell: Callable[[str, str, float], None]
) -> Iterator[tuple[MotorJob, str]]:
    """Fit motors on this machine; yield each job with its error message, or "" on success.

    `tell` receives motor, stage and completed fraction of a fit.
    """
    if not jobs:
        return
    pipeline = os.environ.get("MOTORID_PIPELINE", _PIPELINE)
    at_once = min(at_once, len(jobs))
    threads = max(1, cores() // at_once)
    fork_server = ForkServer(
        "app.commands.batch.worker",
        pipeline.partition(":")[0],
        temporary=Path(tempfile.gettempdir()),
    )
    waiting = list(reversed(jobs))
    losses: Counter[str] = Counter()
    running: dict[Task, tuple[MotorJob, dict[str, Any]]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                job = waiting.pop()
                running[fork_server.fork(_task(job, pipeline, threads))] = job, {}
            for task, (job, told) in list(running.items()):
                name = job.motor.name
                for message in task.messages(_WAIT_S / len(running)):
                    told |= message
                    if news := message.get("progress"):
                        tell(name, news["stage"], news["fraction"])
                if not task.has_ended:
                    continue
                del running[task]
                is_lost = not told.keys() & {"done", "failed", "exit"}
                losses[name] += is_lost
                if is_lost and losses[name] < _MOST_LOSSES:
                    # The fork server ended, not the fit: retry.
                    waiting.append(job)
                else:
                    yield job, _reason(told)
    finally:
        # Kill the remaining fits if the command was interrupted.
        fork_server.stop()


def _reason(told: Mapping[str, Any]) -> str:
    """Error message of a fit that has ended, from the fields of its messages; "" on success."""
    if "done" in told:
        return ""
    if "failed" in told:
        return " ".join(str(told["failed"]).split())
    status = told.get("exit")
    how = f"was killed by signal {-status}" if isinstance(status, int) and status < 0 else "crashed"
    return (
        f"its process {how}, possibly for lack of memory; repeat the command with a smaller --jobs"
    )


def _task(job: MotorJob, pipeline: str, threads: int) -> dict[str, Any]:
    motor = job.motor
    mapping = None if motor.mapping is None else str(motor.mapping.absolute())
    names = iter(run_names((*motor.training, *motor.validation)))
    training, validation = (
        tuple(RunFile(str(file.absolute()), next(names), mapping) for file in files)
        for files in (motor.training, motor.validation)
    )
    out, options = str(job.out.absolute()), {**asdict(motor.options), "bench": motor.bench}
    fit = FitJob(motor.name, 1, out, training, validation, options, pipeline)
    fit = replace(fit, threads=threads, motor=motor.name)
    return {"job": asdict(fit), "record": job.record}
