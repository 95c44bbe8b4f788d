"""Dask task: one attempt at a fit, computed in a separate process on the worker's machine.

The task itself computes nothing.  The fork server of the worker forks a process for the fit; the
task forwards the messages of that process and kills it when the task is cancelled.  A crash of a
fit therefore does not end the worker, and a cancelled fit does not run to its end.

Dask runs a task again if its worker was lost, but an attempt must start only once.  A marker file
in the attempt directory records the start.  A second task finds the marker, reports the attempt as
lost and leaves the directory unchanged; the service then starts the next attempt.

Scheduler and workers import this module, so it imports little.
"""

from __future__ import annotations

import os
import threading
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from distributed import Worker, get_worker

from app.fits.job import FitJob, RunFile
from app.fork_server.client import ForkServer

__all__ = ["BEGUN", "TOPIC", "compute"]

TOPIC = "motorid"
"""Dask topic of the events that tasks send."""

BEGUN = ".begun"
"""Marker file in the directory of an attempt: it has started and must not start again."""

_LOOK_S = 0.1
_WANTED = ("executing", "long-running")
_fork_servers: dict[str, ForkServer] = {}
_lock = threading.Lock()


def compute(fields: dict[str, Any], data_dir: str) -> None:
    """Compute a job in a separate process.

    The paths are those of the service; MOTORID_DATA_DIR names the data directory on a worker with
    another path.
    """
    worker = get_worker()
    key = str(worker.get_current_task())
    report = partial(_report, worker, key)
    job = _placed(FitJob.of(fields), Path(data_dir))
    if not _begin(Path(job.directory)):
        report([], has_ended=True)
        return
    report([])
    task = _fork_server(job.pipeline, worker).fork(asdict(job))
    try:
        while not task.has_ended and _is_wanted(worker, key):
            if messages := task.messages(wait_s=_LOOK_S):
                report(messages)
    finally:
        task.kill()
        report([], has_ended=True)


def _report(
    worker: Worker, key: str, messages: list[dict[str, Any]], *, has_ended: bool = False
) -> None:
    event = {"key": key, "worker": worker.address, "messages": messages, "has_ended": has_ended}
    worker.log_event(TOPIC, event)


def _begin(directory: Path) -> bool:
    """Mark an attempt as started; return False if it was started before."""
    try:
        handle = os.open(directory / BEGUN, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    except FileExistsError:
        return False
    os.close(handle)
    return True


def _is_wanted(worker: Worker, key: str) -> bool:
    task = worker.state.tasks.get(key)
    return task is not None and task.state in _WANTED


def _fork_server(pipeline: str, worker: Worker) -> ForkServer:
    module = pipeline.partition(":")[0]
    with _lock:
        if module not in _fork_servers:
            temporary = Path(worker.local_directory)
            _fork_servers[module] = ForkServer("app.fits.worker", module, temporary=temporary)
        return _fork_servers[module]


def _placed(job: FitJob, theirs: Path) -> FitJob:
    """Job with its paths translated to this machine."""
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
