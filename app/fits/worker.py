"""One attempt at one fit, computed in a child of a fork server and reported in lines of JSON.

    {"progress": {"stage": "posterior", "fraction": 0.42}}
    {"done": true}                            all outputs are on the disk
    {"failed": {"code", "detail", ...}}       the input or the calculation; another try is no use

If it ends without one of the last two it has crashed, and the fit is tried again; where it could
tell why, `{"crashed": "..."}` says it.  This is the only place where the service runs the pipeline.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.fits.job import CHECKPOINTS, LOG, Job, RunFile
from app.fits.outputs import seal
from app.nursery.answers import tell
from app.regular import open_regular, sha256_of
from app.space import is_full
from app.storage import sync_directory
from identification.errors import (
    ComputationError,
    ContradictoryRuns,
    InputError,
    RunFileError,
)
from identification.ingest import Run, read_run
from identification.options import FitOptions
from identification.posterior.checkpoint import Checkpoint
from identification.threads import use_threads

__all__ = ["checkpoint_of", "compute", "handle"]

_INTERVAL_S = 0.2
_NICENESS = 5


def handle(task: dict[str, Any], answer: int) -> None:
    """Compute a job and report on the pipe.

    Args:
        task: Fields of a job.
        answer: Pipe to the supervisor.
    """
    job = Job.of(task)
    _move_to(Path(job.directory))
    use_threads(job.threads)
    messages = _Messages(answer)
    try:
        compute(job, messages.progress)
    except InputError as error:
        messages.send({"failed": _input_problem(error)})
    except ComputationError as error:
        messages.send({"failed": {"code": "computation", "detail": str(error)}})
    except OSError as error:
        if not is_full(error):
            raise
        # Trying again at once would meet the same disk.
        detail = "no space was left for the results; have some made, then fit again"
        messages.send({"failed": {"code": "storage_full", "detail": detail}})
    except MemoryError:
        # Beside fewer others there may be enough, so another try is of use.
        messages.send({"crashed": "no memory left"})
        raise
    else:
        messages.send({"done": True})


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
    directory = Path(job.directory)
    more: dict[str, Any] = {}
    if "checkpoint" in inspect.signature(identify).parameters:
        more["checkpoint"] = checkpoint_of(job)
    identify(training, validation, FitOptions(**chosen), progress, **more).write(directory)
    progress("writing", 1.0)
    seal(directory)
    sync_directory(directory)


def checkpoint_of(job: Job) -> Checkpoint:
    """Where an attempt keeps what it has so far, and finds what those before it had.

    Each attempt has a file of its own, so that one that was given up and still runs cannot
    overwrite what its successor keeps.  They lie beside the directories of the attempts, which are
    removed with them, and go with the fit's end.

    Args:
        job: The attempt.
    """
    folder = Path(job.directory).parent / CHECKPOINTS
    found = [path for path in folder.glob("*.npz") if path.stem.isdecimal()]
    earlier = [path for path in found if int(path.stem) < job.attempt]
    earlier.sort(key=lambda path: int(path.stem), reverse=True)
    return Checkpoint(folder / f"{job.attempt}.npz", earlier, job.checkpoint_s)


class _Messages:
    """The pipe to the supervisor; progress is thinned out."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._stage = ""
        self._sent = 0.0

    def progress(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if stage != self._stage or now - self._sent >= _INTERVAL_S:
            self._stage, self._sent = stage, now
            news = {"stage": stage, "fraction": min(max(fraction, 0.0), 1.0)}
            self.send({"progress": news})

    def send(self, message: dict[str, Any]) -> None:
        tell(self._pipe, message)


def _move_to(directory: Path) -> None:
    """Have what is printed, and temporary files, go to the directory of the attempt."""
    os.nice(_NICENESS)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC
    log = os.open(directory / LOG, flags, 0o600)
    for stream in (1, 2):
        os.dup2(log, stream)
    os.environ["TMPDIR"] = str(directory)
    tempfile.tempdir = None


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return found


class _StoredRunLost(InputError):
    """The stored bytes of a run are missing or are not those that were uploaded."""


def _read(run: RunFile) -> Run:
    if run.sha256 is not None:
        _check_stored(Path(run.path), run.name, run.sha256)
    return read_run(run.path, name=run.name, mapping=run.mapping)


def _check_stored(path: Path, name: str, sha256: str) -> None:
    """Compare the stored bytes of a run with the hash of its upload.

    A table that was cut reads as a shorter run, and would give a result without a warning.
    """
    try:
        with open_regular(path) as file:
            state = "" if sha256_of(file) == sha256 else "SHA-256 differs from that of the upload"
    except OSError as error:
        state = error.strerror or str(error)
    if state:
        raise _StoredRunLost(
            f"the stored run is missing or damaged ({state}); upload the same file again, which "
            "restores it, then fit again",
            file=name,
        )


def _input_problem(error: InputError) -> dict[str, Any]:
    if isinstance(error, ContradictoryRuns):
        return {"code": error.code, "detail": str(error), "findings": error.findings}
    code = error.code if isinstance(error, RunFileError) else "input"
    if isinstance(error, _StoredRunLost):
        code = "file_lost"
    place = {"file": error.file, "row": error.row, "column": error.column}
    return {"code": code, "detail": str(error)} | {k: v for k, v in place.items() if v is not None}
