"""Parser of one upload, run in a child of the fork server that limits its own resources.

An untrusted file can crash the interpreter or exhaust the memory, so the server itself never reads
it.  See `app.runs.reading` for the server's side.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from app.fork_server.child import Answers, ProcessLimits, confine
from identification.errors import RunFileError
from identification.ingest import Limits, Run, read_run

__all__ = ["handle"]


def handle(task: dict[str, Any], answer: int) -> None:
    """Parse a run file and report its content or the error.

    Args:
        task: `path`, `name`, `mapping`, `max_rows`, `limits`, and `is_preview` to examine the file
            as `motorid check` does.
        answer: Write end of the pipe to the server.
    """
    confine(ProcessLimits(**task["limits"]))
    limits = Limits(rows=task["max_rows"])
    try:
        if task["is_preview"]:
            _preview(task, limits, Answers(answer))
            return
        run = read_run(task["path"], name=task["name"], mapping=task["mapping"], limits=limits)
        found = {"run": _summary(run)}
    except RunFileError as error:
        found = {"error": _problem(error)}
    except MemoryError:
        found = {"error": {"reason": "reader_memory"}}
    Answers(answer).send(found)


def _preview(task: dict[str, Any], limits: Limits, answers: Answers) -> None:
    """Send the preview of a file, first without the precision, whose computation may fail."""
    from identification.preview import examine

    found = examine([task["path"]], task["mapping"], names=[task["name"]], limits=limits)
    answers.send({"preview": found.content()})
    answers.send({"preview": found.with_prospects().content()})


def _problem(error: RunFileError) -> dict[str, Any]:
    return {
        "message": str(error),
        "reason": error.code,
        "file": error.file,
        "row": error.row,
        "column": error.column,
    }


def _summary(run: Run) -> dict[str, Any]:
    channels = {
        "voltage_V": run.voltage,
        "current_A": run.current,
        "speed_rad_s": run.speed,
        "temperature_degC": run.temperature,
        "position_rad": run.position,
    }
    return {
        "sha256": run.sha256,
        "rows": run.rows,
        "sample_rate_hz": run.sample_rate_hz,
        "duration_s": float(run.time[-1] - run.time[0]),
        "channels": {
            name: {"min": float(np.min(values)), "max": float(np.max(values))}
            for name, values in channels.items()
            if values is not None
        },
        "warnings": [
            {"code": w.code, "message": w.message, "row": w.row, "column": w.column}
            for w in run.warnings
        ],
    }
