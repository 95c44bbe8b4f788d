"""Batch identification on this machine: one process per motor, a fixed number in parallel."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.commands.batch.manifest import Motor
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
    """Entry of the manifest."""
    record: dict[str, Any]
    """Inputs that determine the result."""
    out: Path
    """Output directory of the motor."""


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
    running: list[_Running] = []
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                job = waiting.pop()
                running.append(_Running(job, fork_server.fork(_task(job, pipeline, threads))))
            for one in list(running):
                if one.look(_WAIT_S / len(running), tell):
                    running.remove(one)
                    losses[one.job.motor.name] += one.is_lost
                    if one.is_lost and losses[one.job.motor.name] < _MOST_LOSSES:
                        # The fork server ended, not the fit: retry.
                        waiting.append(one.job)
                        continue
                    yield one.job, one.reason
    finally:
        # Kill the remaining fits if the command was interrupted.
        fork_server.stop()


class _Running:
    """A fit in progress."""

    def __init__(self, job: MotorJob, task: Task) -> None:
        self.job = job
        self.reason = ""
        self.is_lost = False
        self._task = task
        self._has_result = False

    def look(self, wait_s: float, tell: Callable[[str, str, float], None]) -> bool:
        """Process the messages of the fit; return True once it has ended."""
        for message in self._task.messages(wait_s):
            if "progress" in message:
                news = message["progress"]
                tell(self.job.motor.name, news["stage"], news["fraction"])
            elif "failed" in message:
                self.reason = " ".join(str(message["failed"]).split())
            elif "done" in message:
                self._has_result = True
            elif "exit" in message and not self._has_result and not self.reason:
                self.reason = _end_in_words(message["exit"])
        if self._task.has_ended and not self._has_result and not self.reason:
            self.is_lost = True
            self.reason = _end_in_words(None)
        return self._task.has_ended


def _end_in_words(status: object) -> str:
    how = f"was killed by signal {-status}" if isinstance(status, int) and status < 0 else "crashed"
    return (
        f"its process {how}, possibly for lack of memory; repeat the command with a smaller --jobs"
    )


def _task(job: MotorJob, pipeline: str, threads: int) -> dict[str, Any]:
    motor = job.motor
    return {
        "out": str(job.out.absolute()),
        "training": [str(file.absolute()) for file in motor.training],
        "validation": [str(file.absolute()) for file in motor.validation],
        "mapping": None if motor.mapping is None else str(motor.mapping.absolute()),
        "options": asdict(motor.options),
        "label": asdict(motor.label),
        "record": job.record,
        "pipeline": pipeline,
        "threads": threads,
    }
