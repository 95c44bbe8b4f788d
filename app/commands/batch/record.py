"""Provenance record and history of the results in a batch directory.

    DIR/MOTOR/result.json, report.html, posterior.nc
    DIR/MOTOR/batch.json             hashes of the runs, options, and end time of the fit
    DIR/MOTOR/history/TIME.json      earlier results with their records; names sort by time

`batch.json` is written last and deleted first, so its presence proves that the result in the same
directory is complete.  Before a result is replaced, it is copied to the history.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from app.commands.batch.manifest import Motor, unopened
from app.commands.files import read_result
from app.disk import open_regular
from identification.errors import InputError, OptionError
from identification.fleet.refit import Refit, refit_of
from identification.result.atomic import sync, write_text

__all__ = ["finish", "kept_result", "make_way", "previous_refit", "record_of", "remember"]

_RECORD: Final = "batch.json"
_HISTORY: Final = "history"
_MADE_FROM: Final = ("runs", "options", "mapping", "bench")


def record_of(motor: Motor) -> dict[str, Any]:
    """Inputs that determine a result: hashes of the run files, options, hash of the mapping file.

    Raises:
        OptionError: A file cannot be read, or two run files have the same content.
    """
    try:
        runs = {
            role: [_hash(file) for file in files]
            for role, files in (("training", motor.training), ("validation", motor.validation))
        }
        mapping = None if motor.mapping is None else _hash(motor.mapping)
    except OSError as error:
        raise OptionError(unopened(error)) from error
    _refuse_twice((*motor.training, *motor.validation), (*runs["training"], *runs["validation"]))
    # Convert to JSON types, so that the record equals one read from disk.
    options: dict[str, Any] = json.loads(json.dumps(asdict(motor.options)))
    # Omit these options if empty: records from before they existed have no such entries.
    options = {n: v for n, v in options.items() if v or n not in ("known", "nameplate")}
    further = {"mapping": mapping, "bench": motor.bench}
    return {"runs": runs, "options": options} | {n: v for n, v in further.items() if v}


def kept_result(out: Path, record: Mapping[str, Any]) -> tuple[dict[str, Any], str | None] | None:
    """Stored result and its end time if it was made from the inputs in `record`, else None."""
    stored = _stored(out)
    if stored is None or any(stored.get(part) != record.get(part) for part in _MADE_FROM):
        return None
    try:
        return read_result(out / "result.json"), stored.get("ended_at")
    except InputError:
        return None


def make_way(out: Path) -> None:
    """Archive the result of a directory and delete temporary files of a killed writer."""
    for rest in out.glob(".*.part"):
        rest.unlink(missing_ok=True)
    stored = _stored(out)
    if stored is None:
        return
    try:
        result = read_result(out / "result.json")
    except InputError:
        return
    remember(out, stored, result)
    (out / _RECORD).unlink()
    sync(out)


def remember(out: Path, record: Mapping[str, Any], result: Mapping[str, Any]) -> None:
    """Write a result to the history of a directory.

    The file name is the end time of the fit, so writing the same result again has no effect.
    """
    history = out / _HISTORY
    history.mkdir(parents=True, exist_ok=True)
    moment = re.sub(r"[^0-9TZ]", "", record.get("ended_at") or "") or "00000000T000000Z"
    content = json.dumps({"record": record, "result": result}, indent=1, allow_nan=False)
    write_text(history / f"{moment}.json", content + "\n")


def finish(out: Path, record: Mapping[str, Any], ended_at: str) -> None:
    """Mark the result of a directory as complete; this must be the last write."""
    content = json.dumps({**record, "ended_at": ended_at}, indent=2)
    write_text(out / _RECORD, content + "\n")


def previous_refit(motor: str, out: Path) -> Refit | None:
    """Newest readable result in the history of a motor, or None."""
    for path in sorted((out / _HISTORY).glob("*.json"), reverse=True):
        try:
            with open_regular(path) as file:
                entry = json.load(file)
            result, record = entry["result"], entry["record"]
            place = f"{motor}/{_HISTORY}/{path.name}"
            refit = refit_of(motor, "fitted", result)
            return replace(refit, fit=place, ended_at=record.get("ended_at"))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # Not a history file of this program; try the next older file.
            continue
    return None


def _stored(out: Path) -> dict[str, Any] | None:
    try:
        with open_regular(out / _RECORD) as file:
            stored = json.load(file)
    except (OSError, ValueError):
        return None
    return stored if isinstance(stored, dict) else None


def _refuse_twice(files: Sequence[Path], hashes: Sequence[str]) -> None:
    """Reject duplicate run files: a model cannot be validated on the data it was fitted to."""
    first: dict[str, Path] = {}
    for file, found in zip(files, hashes, strict=True):
        if found in first:
            same = (
                "is listed twice"
                if file == first[found]
                else f"has the same content as {first[found]}"
            )
            raise OptionError(f"{file}: {same}; expected each run once, in one role")
        first[found] = file


def _hash(file: Path) -> str:
    # Check the type first: opening a FIFO without a writer would block.
    if not stat.S_ISREG(mode := file.stat().st_mode) and not stat.S_ISDIR(mode):
        raise OptionError(f"{file}: is not a regular file; expected a run or a mapping")
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()
