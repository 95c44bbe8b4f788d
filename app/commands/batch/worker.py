"""Fit of one motor of a batch in a child process of the fork server.

Messages to the parent process, one JSON object per line:

    {"progress": {"stage": "posterior", "fraction": 0.42}}
    {"done": true}                the result and its record are on disk
    {"failed": "..."}             invalid input or failed computation

A child that exits without `done` or `failed` has crashed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.commands.batch.record import finish, make_way
from app.commands.exits import TRACEBACK
from app.fits.job import FitJob
from app.fits.worker import identified
from app.fork_server.child import Answers
from app.logging import warnings_logged
from app.texts import moment
from identification.errors import ComputationError, InputError
from identification.threads import use_threads

__all__ = ["handle"]


def handle(task: dict[str, Any], answer: int) -> None:
    """Fit one motor and report its progress and outcome on the pipe.

    Args:
        task: `job`, whose `directory` is the output directory, and `record` to store with it.
        answer: Write end of the pipe to the command.
    """
    answers = Answers(answer)
    try:
        with warnings_logged():
            _fit(FitJob.of(task["job"]), task["record"], answers.progress)
    except (InputError, ComputationError) as error:
        answers.send({"failed": str(error)})
    except OSError as error:
        answers.send({"failed": f"{error.filename or 'files'}: {error.strerror or error}"})
    except MemoryError:
        answers.send({"failed": "not enough memory; fit fewer motors in parallel (smaller --jobs)"})
    except Exception as error:  # noqa: BLE001  a failed motor must not stop the batch
        answers.send({"failed": f"internal error, {type(error).__name__}: {error}"})
        if os.environ.get(TRACEBACK):
            raise
    else:
        answers.send({"done": True})


def _fit(job: FitJob, record: dict[str, Any], progress: Callable[[str, float], None]) -> None:
    use_threads(job.threads)
    progress("read", 0.0)
    found = identified(job, progress)
    out = Path(job.directory)
    out.mkdir(parents=True, exist_ok=True)
    # The previous result is kept until the new fit has succeeded.
    make_way(out)
    found.write(out)
    finish(out, record, moment(time.time()))
