"""Parser of one upload, run in a child of the fork server that limits its own resources.

An untrusted file can crash the interpreter or exhaust the memory, so the server itself never reads
it.  See `app.runs.reading` for the server's side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.fork_server.child import Answers, ProcessLimits, confine
from identification.checks import check_runs
from identification.errors import RunFileError
from identification.ingest import Column, Limits, Run, read_run
from identification.ingest.columns import similar_columns
from identification.ingest.mapping import ROW
from identification.ingest.read import list_columns
from identification.ingest.units import CHANNEL_QUANTITIES, find_unit

# Imported once in the fork server: each child would need 0.7 s of CPU time for these.
from identification.preview import examine
from identification.reporting.columns import extremes

__all__ = ["handle"]

_BUCKETS = 200
"""Buckets of the plotted samples; a plot is 300 to 600 pixels wide."""
_MOST_COLUMNS = 200
"""Columns offered for selection; a menu of more is unusable."""


def handle(task: dict[str, Any], answer: int) -> None:
    """Parse a run file and report its content or the error.

    Args:
        task: `path`, `name`, `mapping`, `max_rows`, `limits`, and `kind`: "run" to summarise the
            file; "preview" to examine it, and the files in `further`, as `motorid check` does;
            "pending" to show it to a user who corrects the mapping.
        answer: Write end of the pipe to the server.
    """
    confine(ProcessLimits(**task["limits"]))
    limits = Limits(rows=task["max_rows"])
    try:
        if task["kind"] == "preview":
            _preview(task, limits, Answers(answer))
            return
        if task["kind"] == "pending":
            Answers(answer).send({"pending": _pending(task, limits)})
            return
        run = read_run(task["path"], name=task["name"], mapping=task["mapping"], limits=limits)
        found = {"run": _summary(run)}
    except RunFileError as error:
        found = {"error": _problem(error)}
    except MemoryError:
        found = {"error": {"reason": "reader_memory"}}
    Answers(answer).send(found)


def _preview(task: dict[str, Any], limits: Limits, answers: Answers) -> None:
    """Send the preview of files, first without the precision, whose computation may fail."""
    files = [(task["path"], task["name"], task["mapping"]), *task["further"]]
    mapping = task["mapping"]
    names = [name for _, name, _ in files]
    if len(files) > 1:
        # Runs may share a file name, and each has a mapping of its own.
        names = [n if names.count(n) == 1 else f"{n} ({at})" for at, n in enumerate(names, 1)]
        mapping = {
            "files": {name: own or {} for name, (_, _, own) in zip(names, files, strict=True)}
        }
    found = examine([path for path, _, _ in files], mapping, names=names, limits=limits)
    answers.send({"preview": found.content()})
    answers.send({"preview": found.with_prospects().content()})


def _pending(task: dict[str, Any], limits: Limits) -> dict[str, Any]:
    """Columns, preview without the precision, summary and plotted samples of a file.

    An entry of the mapping of a bench applies only if the file has its column, without its unit if
    the file states another one.
    """
    mapping, stated = task["mapping"], []
    try:
        columns = list_columns(task["path"], name=task["name"], limits=limits)
    except RunFileError:
        # The preview reports the same error.
        columns = ()
    if task["is_of_bench"]:
        mapping = {
            channel: entry
            for channel, entry in (mapping or {}).items()
            if all(
                any(column.has_name(entry[key]) for column in columns)
                for key in ("column", "sign")
                if key in (entry or {}) and entry[key] != ROW
            )
        }
        stated = [
            (channel, own, mapping[channel].pop("unit"))
            for channel, entry in mapping.items()
            for column in columns
            if entry and column.has_name(entry.get("column", ""))
            if (own := _own_unit(column, entry))
        ]
        mapping = mapping or None
    found = examine([task["path"]], mapping, names=[task["name"]], limits=limits)
    run = found.runs[0] if found.runs else None
    summary = None if run is None else _summary(run)
    if summary is not None:
        summary["warnings"] += [
            {
                "code": "unit_overridden",
                "message": f"the mapping of the bench gives {saved} and the header {own}; the "
                "header is used",
                "row": None,
                "column": channel,
            }
            for channel, own, saved in stated
        ]
    return {
        "mapping": mapping,
        "columns": [
            {"title": column.title, "unit": column.unit and column.unit.name}
            for column in columns[:_MOST_COLUMNS]
        ],
        "suggested": _suggested(columns),
        "preview": found.content(),
        "summary": summary,
        "samples": {} if run is None else _samples(run),
    }


def _own_unit(column: Column, entry: dict[str, Any]) -> str:
    """Unit that a column states against an entry that neither names nor scales it; else empty.

    An entry for ``n [rpm]`` in rad/s is a correction of that header.
    """
    own, saved = column.unit, find_unit(str(entry.get("unit", "")))
    if own is None or saved is None or own == saved or own.quantity != saved.quantity:
        return ""
    is_named = any(text in entry["column"] for text in column.unit_texts)
    return "" if is_named or {"scale", "offset"} & entry.keys() else own.name


def _suggested(columns: Sequence[Column]) -> dict[str, str]:
    """Title of the only column that may hold a channel, for each channel that has one.

    A user sees the suggestion and confirms it by correcting another field; nothing is read with it.
    """
    found: dict[str, str] = {}
    # Twice: a column T may be the time until it is the only one for the temperature.
    for channel, quantity in [*CHANNEL_QUANTITIES.items()] * 2:
        if channel in found:
            continue
        free = [column for column in columns if column.title not in found.values()]
        candidates = (
            [column for column in free if column.canonical == channel]
            or [column for column in free if quantity in column.quantities]
            or similar_columns(channel, free)
        )
        if len(candidates) == 1:
            found[channel] = candidates[0].title
    return found


def _samples(run: Run) -> dict[str, list[float]]:
    """Extremes of each channel over time, for a plot."""
    channels = run.channels
    kept = extremes(list(channels.values()), _BUCKETS)
    # Six digits are finer than a screen shows.
    return {
        name: [float(f"{value:.6g}") for value in values[kept]]
        for name, values in {"time_s": run.time, **channels}.items()
    }


def _problem(error: RunFileError) -> dict[str, Any]:
    return {
        "message": str(error),
        "reason": error.code,
        "file": error.file,
        "row": error.row,
        "column": error.column,
    }


def _summary(run: Run) -> dict[str, Any]:
    """Extent, ranges and warnings of a run, with the contradictions that would refuse its fit."""
    contradictions = check_runs([run]).refused
    found = [(f.code, f.message, f.column, None) for f in contradictions]
    warned = [(w.code, w.message, w.column, w.row) for w in run.warnings]
    return {
        "sha256": run.sha256,
        "rows": run.rows,
        "sample_rate_hz": run.sample_rate_hz,
        "duration_s": float(run.time[-1] - run.time[0]),
        "channels": {
            name: {"min": float(np.min(values)), "max": float(np.max(values))}
            for name, values in run.channels.items()
        },
        "warnings": [
            {"code": code, "message": message, "row": row, "column": column}
            for code, message, column, row in (*found, *warned)
        ],
    }
