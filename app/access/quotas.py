"""Workspace quotas on stored runs and waiting fits.

Each quota is checked in the transaction that adds the data, under a lock on the workspace, so that
two concurrent calls cannot both use the last free place.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.errors import BatchQuota, BytesQuota, RunsQuota, WaitingQuota
from app.tables import FitRow, PendingRow, RunRow

__all__ = ["Quotas"]

_HELD = 0x6D6F746F
"""First 32-bit key of the PostgreSQL advisory locks on workspaces."""


@dataclass(frozen=True)
class Quotas:
    """Quotas of each workspace; 0 means unlimited."""

    stored_bytes: int = 0
    """Total size of its run files [bytes]."""
    runs: int = 0
    waiting_fits: int = 0

    def check_run(self, session: Session, workspace: str, size: int) -> None:
        """Raise `BytesQuota` or `RunsQuota` for a run that would exceed a quota, pending or not."""
        if not self.stored_bytes and not self.runs:
            return
        _hold(session, workspace)
        number = stored = 0
        for table in (RunRow, PendingRow):
            query = select(func.count(), func.coalesce(func.sum(table.bytes), 0))
            counted = session.execute(query.where(table.workspace == workspace)).one()
            number, stored = number + int(counted[0]), stored + int(counted[1])
        if self.runs and number >= self.runs:
            raise RunsQuota(
                f"the workspace has {number} runs of {self.runs} allowed; delete runs that no "
                "fit needs, or ask the operator to raise MOTORID_QUOTA_RUNS"
            )
        if self.stored_bytes and stored + size > self.stored_bytes:
            raise BytesQuota(
                f"the runs of the workspace have {stored} bytes of {self.stored_bytes} allowed, "
                f"and the new run has {size}; delete runs, or ask the operator to raise "
                "MOTORID_QUOTA_BYTES"
            )

    def check_fits(self, session: Session, workspace: str, number: int) -> None:
        """Raise `WaitingQuota` for fits that would exceed the quota, `BatchQuota` if alone."""
        if not self.waiting_fits:
            return
        if number > self.waiting_fits:
            raise BatchQuota(
                f"the batch has {number} motors, and {self.waiting_fits} fits of the workspace may "
                "wait; send the motors as smaller batches, or ask the operator to raise "
                "MOTORID_QUOTA_WAITING_FITS"
            )
        _hold(session, workspace)
        query = select(func.count()).where(FitRow.status == "queued", FitRow.workspace == workspace)
        waiting = session.execute(query).scalar_one()
        if waiting + number > self.waiting_fits:
            raise WaitingQuota(
                f"{waiting} fits of the workspace wait and {number} more exceed the quota "
                f"of {self.waiting_fits}; wait until some have ended, or ask the operator to raise "
                "MOTORID_QUOTA_WAITING_FITS"
            )


def _hold(session: Session, workspace: str) -> None:
    """Lock the workspace until the transaction ends; SQLite allows only one writer anyway."""
    if session.get_bind().dialect.name == "postgresql":
        session.execute(select(func.pg_advisory_xact_lock(_HELD, func.hashtext(workspace))))
