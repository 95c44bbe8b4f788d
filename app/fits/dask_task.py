"""One attempt at one fit as a task of a Dask worker.

The task computes nothing itself: it has a nursery of its worker fork a process for the fit, hands
on what that process tells, and kills it when nobody wants the task any more.  So a fit that
crashes takes no worker with it, and one that was cancelled does not run to its end.

Dask runs a task again when its worker was lost.  An attempt is begun once, though: a file in its
directory says that it was, and a second task tells that it is lost and leaves it alone.  The
service then makes the next attempt.

Scheduler and workers load this module, so it imports little.
"""

from __future__ import annotations

import os
import threading
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from distributed import Worker, get_worker

from app.fits.job import Job, RunFile
from app.nursery.client import Nursery

__all__ = ["BEGUN", "TOPIC", "compute"]

TOPIC = "motorid"
"""Topic of the events by which tasks tell of their fits."""

BEGUN = ".begun"
"""File in the directory of an attempt: it was begun, and is not begun again."""

_LOOK_S = 0.1
_WANTED = ("executing", "long-running")
_nurseries: dict[str, Nursery] = {}
_lock = threading.Lock()


def compute(fields: dict[str, Any], data_dir: str) -> None:
    """Compute a job in a process of its own.

    Args:
        fields: Fields of the job, with paths as the service has them.
        data_dir: The data directory as the service has it; a worker that has it elsewhere is told
            by MOTORID_DATA_DIR.
    """
    worker = get_worker()
    key = str(worker.get_current_task())
    told = _Teller(worker, key)
    job = _placed(Job.of(fields), Path(data_dir))
    if not _begin(Path(job.directory)):
        told.tell([], has_ended=True)
        return
    told.tell([])
    task = _nursery(job.pipeline, worker).fork(asdict(job))
    try:
        while not task.has_ended and _is_wanted(worker, key):
            if messages := task.messages(wait_s=_LOOK_S):
                told.tell(messages)
    finally:
        task.kill()
        told.tell([], has_ended=True)


@dataclass(frozen=True)
class _Teller:
    worker: Worker
    key: str

    def tell(self, messages: list[dict[str, Any]], *, has_ended: bool = False) -> None:
        event = {
            "key": self.key,
            "worker": self.worker.address,
            "messages": messages,
            "has_ended": has_ended,
        }
        self.worker.log_event(TOPIC, event)


def _begin(directory: Path) -> bool:
    """Mark an attempt as begun; False where it was begun before."""
    try:
        handle = os.open(directory / BEGUN, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    except FileExistsError:
        return False
    os.close(handle)
    return True


def _is_wanted(worker: Worker, key: str) -> bool:
    task = worker.state.tasks.get(key)
    return task is not None and task.state in _WANTED


def _nursery(pipeline: str, worker: Worker) -> Nursery:
    """The worker's process that forks those that compute with a pipeline."""
    module = pipeline.partition(":")[0]
    with _lock:
        if module not in _nurseries:
            temporary = Path(worker.local_directory)
            _nurseries[module] = Nursery("app.fits.worker", module, temporary=temporary)
        return _nurseries[module]


def _placed(job: Job, theirs: Path) -> Job:
    """A job with its paths as this machine has them."""
    ours = Path(os.environ.get("MOTORID_DATA_DIR") or theirs).absolute()

    def place(path: str) -> str:
        return str(ours / Path(path).relative_to(theirs))

    def runs(files: tuple[RunFile, ...]) -> tuple[RunFile, ...]:
        return tuple(replace(file, path=place(file.path)) for file in files)

    return replace(
        job,
        directory=place(job.directory),
        training=runs(job.training),
        validation=runs(job.validation),
    )
