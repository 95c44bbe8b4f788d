"""One attempt at one fit: read the runs, run the pipeline, leave the outputs on the disk.

This is the only place where the service runs the pipeline.  It is kept out of `app.fits.worker`,
which has to tie its life to the supervisor's before it spends seconds on imports.
"""

from __future__ import annotations

import dataclasses
import importlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.fits.job import OUTPUTS, Job, RunFile
from app.storage import sync_directory
from identification.errors import ComputationError, InputError, RunFileError
from identification.ingest import Run, read_run
from identification.options import FitOptions

__all__ = ["compute", "outcome"]


def outcome(job: Job, progress: Callable[[str, float], None]) -> dict[str, Any]:
    """Compute a job and say how it ended, as a message to the supervisor.

    Args:
        job: What to compute, and where its outputs go.
        progress: Told the stage and the fraction of the whole that is done.
    """
    try:
        compute(job, progress)
    except InputError as error:
        return {"failed": _input_problem(error)}
    except ComputationError as error:
        return {"failed": {"code": "computation", "detail": str(error)}}
    return {"done": True}


def compute(job: Job, progress: Callable[[str, float], None]) -> None:
    """Compute a job, and leave its outputs on the disk.

    Args:
        job: What to compute, and where its outputs go.
        progress: Told the stage and the fraction of the whole that is done.

    Raises:
        InputError: The runs or the options are at fault.
        ComputationError: They were sound, and the calculation still did not succeed.
    """
    progress("reading", 0.0)
    identify = _function(job.pipeline)
    training = [_read(run) for run in job.training]
    validation = [_read(run) for run in job.validation]
    known = {field.name for field in dataclasses.fields(FitOptions)}
    chosen: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in job.options.items()
        if name in known
    }
    options = FitOptions(**chosen)
    directory = Path(job.directory)
    identify(training, validation, options, progress).write(directory)
    progress("writing", 1.0)
    for name in OUTPUTS:
        if (directory / name).exists():
            with (directory / name).open("rb") as file:
                os.fsync(file.fileno())
    sync_directory(directory)


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return found


def _read(run: RunFile) -> Run:
    return read_run(run.path, name=run.name, mapping=run.mapping)


def _input_problem(error: InputError) -> dict[str, Any]:
    code = error.code if isinstance(error, RunFileError) else "input"
    place = {"file": error.file, "row": error.row, "column": error.column}
    return {"code": code, "detail": str(error)} | {k: v for k, v in place.items() if v is not None}
