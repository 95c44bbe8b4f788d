"""Request for a fit, validated before anything is stored."""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.access.service import Caller
from app.database import portions
from app.errors import FieldRefused, NotFound
from app.fits.job import options_of
from app.identifiers import is_id, new_id
from app.tables import FitRow, RunRow
from app.texts import checked_label

__all__ = ["FitRequest", "check_runs", "checked_key", "new_row", "request_hash"]

_KEY = re.compile(r"[\x21-\x7e]{1,255}")


@dataclass(frozen=True)
class FitRequest:
    """Content of a request for a fit."""

    training: Sequence[str]
    """IDs of the training runs, in the order of recording."""
    validation: Sequence[str]
    options: Mapping[str, Any]
    """Fields of `identification.options.FitOptions`, and `bench` if it is known."""
    motor: str | None = None
    motor_type: str | None = None
    """Type of the motor, by which a batch pools its results, or None."""


def new_row(caller: Caller, request: FitRequest) -> FitRow:
    """Build the row of a queued fit without storing it.

    Raises:
        FieldRefused: A run is named twice, or the name or the type of the motor is invalid.
        OptionError: An option is invalid.
    """
    ids = [*request.training, *request.validation]
    if len(set(ids)) < len(ids):
        raise FieldRefused("a run is given twice; give each run once, in one role", "training")
    # Lazy import: scipy would slow down every start.
    from identification.speed_loop.controller import parse_controllers

    parse_controllers(options_of(request.options).controllers)
    return FitRow(
        id=new_id("fit"),
        workspace=caller.workspace,
        motor=checked_label("motor", request.motor),
        motor_type=checked_label("type", request.motor_type),
        options=dict(request.options),
        status="queued",
        stage="queued",
        fraction=0.0,
        version=1,
        attempt=0,
        failures=0,
        interruptions=0,
        created_at=time.time(),
        request_sha256=request_hash(request),
        position=0,
    )


def check_runs(session: Session, caller: Caller, *requests: FitRequest) -> list[str | None]:
    """Check that the runs exist and that no validation run equals a training run of the same fit.

    The rows of the runs stay locked against deletion until the session ends.

    Returns:
        For each request the motor to which all of its runs belong; None if there is none.

    Raises:
        NotFound: A run is not in the caller's workspace; with several requests, the message names
            the one concerned.
        FieldRefused: A validation run has the same bytes as a training run, read with
            another mapping.
    """
    # One query for all runs keeps the write transaction short.
    named = {run_id for r in requests for run_id in (*r.training, *r.validation)}
    stored = _stored(
        session, caller.workspace, [run_id for run_id in named if is_id("run", run_id)]
    )
    hashes = {run_id: sha256 for run_id, (sha256, _, _) in stored.items()}
    shared: list[str | None] = []
    for position, request in enumerate(requests):
        place = f"motors.{position} ({request.motor or 'no name'}): " if len(requests) > 1 else ""
        for run_id in (*request.training, *request.validation):
            if run_id not in hashes:
                raise NotFound(
                    f"{place}there is no run {run_id[:60]!r}; GET /api/v1/runs lists them"
                )
        fitted = {hashes[run_id]: run_id for run_id in request.training}
        for run_id in request.validation:
            if same := fitted.get(hashes[run_id]):
                raise FieldRefused(
                    f"{place}validation: {stored[run_id][2]} ({run_id}) has the same bytes as "
                    f"{stored[same][2]} ({same}) in training; use runs that are not fitted",
                    "validation",
                )
        motors = {stored[run_id][1] for run_id in (*request.training, *request.validation)}
        shared.append(motors.pop() if len(motors) == 1 else None)
    return shared


def _stored(
    session: Session, workspace: str, run_ids: Sequence[str]
) -> dict[str, tuple[str, str | None, str]]:
    """SHA-256, motor and file of the runs that exist, by ID; locks their rows against deletion."""
    # SQLite rates an index on the workspace as more selective than 500 IDs and would read all runs
    # of the workspace in each query.  No index applies to an expression.
    is_theirs = RunRow.workspace.concat("") == workspace
    found: dict[str, tuple[str, str | None, str]] = {}
    columns = RunRow.id, RunRow.sha256, RunRow.motor, RunRow.file
    for some in portions(run_ids):
        query = select(*columns).where(RunRow.id.in_(some), is_theirs)
        rows = session.execute(query.with_for_update(read=True))
        found.update((run_id, (sha256, motor, file)) for run_id, sha256, motor, file in rows)
    return found


def checked_key(key: str | None) -> str | None:
    """Return an Idempotency-Key; raise `FieldRefused` unless it is visible ASCII characters."""
    if key is not None and not _KEY.fullmatch(key):
        raise FieldRefused(
            "Idempotency-Key: expected 1 to 255 visible ASCII characters", "Idempotency-Key"
        )
    return key


def request_hash(*requests: FitRequest) -> str:
    """Hash that identifies equal requests, whatever the order of their fields."""
    # The type only if given, so that requests of earlier versions keep their hash.
    content = [
        [list(r.training), list(r.validation), dict(r.options), r.motor]
        + ([r.motor_type] if r.motor_type else [])
        for r in requests
    ]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
