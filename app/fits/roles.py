"""Assignment of runs to fits, with their role and order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from app.database import portions
from app.fits.request import FitRequest
from app.tables import FitRunRow, RunRow

__all__ = ["Role", "add", "ids_of", "runs_of"]

Role = Literal["training", "validation"]


def add(session: Session, fits: Iterable[tuple[str, FitRequest]]) -> None:
    """Store the runs of several fits in one statement."""
    # Use plain rows: ORM objects would hold the write lock many times as long.
    rows = [
        {"fit_id": fit_id, "role": role, "position": position, "run_id": run_id}
        for fit_id, request in fits
        for role, ids in (("training", request.training), ("validation", request.validation))
        for position, run_id in enumerate(ids)
    ]
    session.connection().execute(insert(FitRunRow), rows)


def ids_of(session: Session, fit_ids: Sequence[str]) -> dict[str, dict[str, list[str]]]:
    """IDs of the runs of several fits, in order, by fit and role."""
    found: dict[str, dict[str, list[str]]] = {
        fit_id: {"training": [], "validation": []} for fit_id in fit_ids
    }
    for some in portions(fit_ids):
        # Select columns: a page of fits can have 100,000 runs, too many for ORM objects.
        query = (
            select(FitRunRow.fit_id, FitRunRow.role, FitRunRow.run_id)
            .where(FitRunRow.fit_id.in_(some))
            .order_by(FitRunRow.fit_id, FitRunRow.role, FitRunRow.position)
        )
        for fit_id, role, run_id in session.execute(query):
            found[fit_id][role].append(run_id)
    return found


def runs_of(session: Session, fit_id: str, role: Role) -> Sequence[RunRow]:
    """Runs of a fit in one role, in order."""
    query = (
        select(RunRow)
        .join(FitRunRow, FitRunRow.run_id == RunRow.id)
        .where(FitRunRow.fit_id == fit_id, FitRunRow.role == role)
        .order_by(FitRunRow.position)
    )
    return session.scalars(query).all()
