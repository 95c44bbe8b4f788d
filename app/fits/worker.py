"""The process that computes one fit: `python -m app.fits.worker JOB PIPE PARENT`.

It ends with its supervisor, whatever happens: that is seen to before anything else is imported.
It tells of its progress in lines of JSON on the pipe:

    {"progress": {"stage": "posterior", "fraction": 0.42}}
    {"done": true}                            all outputs are on the disk
    {"failed": {"code", "detail", ...}}       the input or the calculation; another try is no use

If it ends without one of the last two it has crashed, and the fit is tried again.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from app.confine import die_with_parent, prefer_as_victim
from app.fits.job import Job

__all__ = ["main"]

_INTERVAL_S = 0.2
_NICENESS = 5


class _Messages:
    """The pipe to the supervisor; progress is thinned out."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._stage = ""
        self._sent = 0.0

    def progress(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if stage != self._stage or now - self._sent >= _INTERVAL_S:
            self._stage, self._sent = stage, now
            news = {"stage": stage, "fraction": min(max(fraction, 0.0), 1.0)}
            self.send({"progress": news})

    def send(self, message: dict[str, Any]) -> None:
        os.write(self._handle, json.dumps(message).encode() + b"\n")


def main(job: Path, handle: int, parent: int) -> None:
    """Compute a job and report on the pipe.

    Args:
        job: File that describes the job.
        handle: File descriptor of the pipe.
        parent: Process of the supervisor.
    """
    die_with_parent(parent)
    prefer_as_victim()
    os.nice(_NICENESS)
    messages = _Messages(handle)
    from app.fits.computation import outcome

    messages.send(outcome(Job.load(job), messages.progress))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
