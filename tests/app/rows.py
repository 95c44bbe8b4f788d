"""Database rows for tests, in the form that the service writes."""

from __future__ import annotations

import secrets
import time

from app.database import Database
from app.identifiers import new_id
from app.tables import FitRow, FitRunRow, RunRow


def run_row(
    workspace: str, *, size: int = 10, created_at: float | None = None, sent_at: float | None = None
) -> RunRow:
    """Row of a run with unique content."""
    return RunRow(
        id=new_id("run"),
        workspace=workspace,
        sha256=secrets.token_hex(32),
        mapping_sha256="",
        mapping=None,
        file="a.csv",
        motor=None,
        bytes=size,
        rows=60,
        sample_rate_hz=1000.0,
        duration_s=0.059,
        channels={},
        warnings=[],
        created_at=time.time() if created_at is None else created_at,
        sent_at=sent_at,
    )


def fit_row(
    workspace: str, status: str, *, ended_at: float | None = None, batch_id: str | None = None
) -> FitRow:
    """Row of a fit in a given state."""
    return FitRow(
        id=new_id("fit"),
        workspace=workspace,
        motor=None,
        options={},
        status=status,
        stage=status,
        fraction=0.0,
        version=1,
        attempt=1,
        failures=0,
        interruptions=0,
        owner=None,
        lease_until=None,
        error=None,
        created_at=time.time() if ended_at is None else ended_at,
        started_at=None,
        ended_at=ended_at,
        idempotency_key=None,
        request_sha256="",
        batch_id=batch_id,
        position=0,
    )


def keep_runs(database: Database, workspace: str, number: int) -> list[str]:
    """Insert many runs and return their IDs."""
    with database.writing() as session:
        rows = [run_row(workspace) for _ in range(number)]
        session.add_all(rows)
    return [row.id for row in rows]


def role_row(fit: FitRow, run: RunRow) -> FitRunRow:
    """Row that assigns a run to a fit."""
    return FitRunRow(fit_id=fit.id, role="training", position=0, run_id=run.id)
