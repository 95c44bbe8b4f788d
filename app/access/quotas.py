"""Quotas: how much one workspace may keep and have waiting.

Each is asked in the transaction that would exceed it, with the workspace held for its length, so
that two calls at the same moment cannot both take the last place.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.errors import BatchQuota, BytesQuota, RunsQuota, WaitingQuota
from app.tables import FitRow, RunRow

__all__ = ["Quotas"]

_HELD = 0x6D6F746F
"""First half of the names of the locks that PostgreSQL keeps for workspaces."""


@dataclass(frozen=True)
class Quotas:
    """What each workspace may have; 0 is no limit.

    Args:
        stored_bytes: Bytes of its run files [bytes].
        runs: Its runs.
        waiting_fits: Its fits that have not begun.
    """

    stored_bytes: int = 0
    runs: int = 0
    waiting_fits: int = 0

    def check_run(self, session: Session, workspace: str, size: int) -> None:
        """Refuse a run for which a workspace has no place.

        Args:
            session: A session that writes, or only reads where nothing is kept yet.
            workspace: The workspace.
            size: Size of the run file [bytes].

        Raises:
            BytesQuota: Its files would have more bytes than it may keep.
            RunsQuota: It has as many runs as it may.
        """
        if not self.stored_bytes and not self.runs:
            return
        _hold(session, workspace)
        query = select(func.count(), func.coalesce(func.sum(RunRow.bytes), 0))
        number, stored = session.execute(query.where(RunRow.workspace == workspace)).one()
        if self.runs and number >= self.runs:
            raise RunsQuota(
                f"the workspace has {number} runs of {self.runs} that it may keep; delete some "
                "that no fit needs, or have MOTORID_QUOTA_RUNS raised"
            )
        if self.stored_bytes and stored + size > self.stored_bytes:
            raise BytesQuota(
                f"the workspace keeps {stored} bytes of {self.stored_bytes} that it may, and the "
                f"run has {size}; delete some runs, or have MOTORID_QUOTA_BYTES raised"
            )

    def check_fits(self, session: Session, workspace: str, number: int) -> None:
        """Refuse fits for which a workspace has no place in the queue.

        Args:
            session: A session that writes.
            workspace: The workspace.
            number: How many fits would be added.

        Raises:
            WaitingQuota: More fits would wait than may.
            BatchQuota: The same, were there no others.
        """
        if not self.waiting_fits:
            return
        if number > self.waiting_fits:
            raise BatchQuota(
                f"the batch has {number} motors, and {self.waiting_fits} fits of the workspace may "
                "wait; send the motors as smaller batches, or have MOTORID_QUOTA_WAITING_FITS "
                "raised"
            )
        _hold(session, workspace)
        query = select(func.count()).where(FitRow.status == "queued", FitRow.workspace == workspace)
        waiting = session.execute(query).scalar_one()
        if waiting + number > self.waiting_fits:
            raise WaitingQuota(
                f"{waiting} fits of the workspace wait and {number} more would be "
                f"{waiting + number} of {self.waiting_fits} that may; let some end, or have "
                "MOTORID_QUOTA_WAITING_FITS raised"
            )


def _hold(session: Session, workspace: str) -> None:
    """Have others of this workspace wait until the session ends; SQLite has one writer anyway."""
    if session.get_bind().dialect.name == "postgresql":
        session.execute(select(func.pg_advisory_xact_lock(_HELD, func.hashtext(workspace))))
