"""One attempt at a fit, computed in a child process of the fork server.

Messages to the supervisor, one JSON object per line:

    {"progress": {"stage": "posterior", "fraction": 0.42}}
    {"done": true}                            all outputs are on disk
    {"failed": {"code", "detail", ...}}       invalid input or failed computation; no retry
    {"crashed": "..."}                        cause of a crash, if the child knows it

A child that exits without `done` or `failed` has crashed, and the fit is retried.  No other module
of the service runs the pipeline.
"""

from __future__ import annotations

import inspect
import os
import pkgutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.disk import is_full, open_regular, sha256_of
from app.fits.job import LOG, FitJob, RunFile, options_of
from app.fits.outputs import seal
from app.fork_server.child import Answers
from app.storage import CHECKPOINTS
from identification.errors import ComputationError, InputError
from identification.ingest import Run, read_run
from identification.label import Label
from identification.posterior.checkpoint import Checkpoint
from identification.result.atomic import sync
from identification.threads import use_threads

if TYPE_CHECKING:
    from identification.pipeline import Identification

__all__ = ["checkpoint_of", "handle", "identified"]

_NICENESS = 5


def handle(task: dict[str, Any], answer: int) -> None:
    """Compute a job and report its progress and outcome on the pipe to the supervisor."""
    job = FitJob.of(task)
    _move_to(Path(job.directory))
    use_threads(job.threads)
    answers = Answers(answer)
    try:
        _compute(job, answers.progress)
    except InputError as error:
        answers.send({"failed": _input_problem(error)})
    except ComputationError as error:
        answers.send({"failed": {"code": "computation", "detail": str(error)}})
    except OSError as error:
        if not is_full(error):
            raise
        # An immediate retry would find the same full disk.
        detail = "the disk is full; ask the operator to free space, then repeat the fit"
        answers.send({"failed": {"code": "storage_full", "detail": detail}})
    except MemoryError:
        # With fewer fits in parallel the memory may suffice, so a retry is useful.
        answers.send({"crashed": "out of memory"})
        raise
    else:
        answers.send({"done": True})


def _compute(job: FitJob, progress: Callable[[str, float], None]) -> None:
    progress("reading", 0.0)
    directory = Path(job.directory)
    identified(job, progress, checkpoint_of(job)).write(directory)
    progress("writing", 1.0)
    seal(directory)
    sync(directory)


def identified(
    job: FitJob, progress: Callable[[str, float], None], checkpoint: Checkpoint | None = None
) -> Identification:
    """Identify the motor of a job, from its runs to a result with its label.

    Raises:
        InputError: The runs or the options are invalid.
        ComputationError: The computation failed on valid input.
    """
    identify = pkgutil.resolve_name(job.pipeline)
    training = [_read(run) for run in job.training]
    validation = [_read(run) for run in job.validation]
    more: dict[str, Any] = {}
    if checkpoint is not None and "checkpoint" in inspect.signature(identify).parameters:
        more["checkpoint"] = checkpoint
    found: Identification = identify(
        training, validation, options_of(job.options), progress, **more
    )
    found.result.update(Label(job.motor, job.options.get("bench", "")).member())
    return found


def checkpoint_of(job: FitJob) -> Checkpoint:
    """Checkpoint files of an attempt: its own and those of earlier attempts, newest first.

    Each attempt writes a separate file, so an abandoned attempt that still runs cannot overwrite
    the checkpoint of its successor.  The files lie outside the attempt directories, which are
    deleted with their attempts, and are deleted when the fit ends.
    """
    folder = Path(job.directory).parent / CHECKPOINTS
    found = [path for path in folder.glob("*.npz") if path.stem.isdecimal()]
    earlier = [path for path in found if int(path.stem) < job.attempt]
    earlier.sort(key=lambda path: int(path.stem), reverse=True)
    return Checkpoint(folder / f"{job.attempt}.npz", earlier, job.checkpoint_s)


def _move_to(directory: Path) -> None:
    """Lower the priority; redirect output and temporary files to the attempt directory."""
    os.nice(_NICENESS)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC
    log = os.open(directory / LOG, flags, 0o600)
    for stream in (1, 2):
        os.dup2(log, stream)
    os.environ["TMPDIR"] = str(directory)
    tempfile.tempdir = None


class _StoredRunLost(InputError):
    """The stored file of a run is missing or differs from the upload."""

    code = "file_lost"


def _read(run: RunFile) -> Run:
    """Read a stored run after a comparison of its SHA-256 with that of its upload.

    A truncated table reads as a shorter run and would give a result without a warning.
    """
    state = ""
    try:
        if run.sha256 is not None:
            with open_regular(Path(run.path)) as file:
                if sha256_of(file) != run.sha256:
                    state = "SHA-256 differs from that of the upload"
    except OSError as error:
        state = error.strerror or str(error)
    if state:
        raise _StoredRunLost(
            f"the stored run is missing or damaged ({state}); upload the same file again to "
            "restore it, then repeat the fit",
            file=run.name,
        )
    return read_run(run.path, name=run.name, mapping=run.mapping)


def _input_problem(error: InputError) -> dict[str, Any]:
    names = ("file", "row", "column", "findings")
    more = {name: getattr(error, name, None) for name in names}
    code = getattr(error, "code", "input")
    return {"code": code, "detail": str(error)} | {k: v for k, v in more.items() if v is not None}
