"""Pending runs: uploaded files whose mapping a user checks before they become runs.

A pending run is kept in the database with what was found in it, so that a reload of the page or a
second browser shows the same.  The mapping of a bench applies to the next files from this bench.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app import queries
from app.access.quotas import Quotas
from app.access.service import Caller
from app.database import Database
from app.disk import open_regular
from app.errors import FileLost, NotFound, RunRefused
from app.identifiers import new_id
from app.runs.reading import RunReader
from app.runs.service import mapping_digest, new_run, stored_before
from app.runs.upload import Upload
from app.storage import Storage, refused_when_full
from app.tables import BenchRow, PendingRow, RunRow
from app.texts import checked_label

__all__ = ["PendingRuns"]

_KEPT = ("id", "file", "motor", "bytes")


class PendingRuns:
    """Operations on pending runs; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have.
    """

    def __init__(
        self, database: Database, storage: Storage, reader: RunReader, quotas: Quotas
    ) -> None:
        self._database = database
        self._storage = storage
        self._reader = reader
        self._quotas = quotas

    def add(self, caller: Caller, upload: Upload) -> PendingRow:
        """Examine an upload and keep it, even if it cannot be read yet; its file is moved.

        Raises:
            RunRefused: Examining the file exceeds the limits.
            FieldRefused: The name of the motor or of the bench is not accepted.
            QuotaExceeded: The quota of the workspace does not allow another run of this size.
            StorageFull: No disk space is left.
        """
        motor = checked_label("motor", upload.fields.get("motor"))
        bench = checked_label("bench", upload.fields.get("bench"))
        with self._database.reading() as session:
            self._quotas.check_run(session, caller.workspace, upload.size)
            saved = _mapping_of_bench(session, caller.workspace, bench)
        found = self._reader.pending(upload.path, upload.name, saved, is_of_bench=True)
        return self._keep(
            caller,
            upload.path,
            found,
            sha256=upload.sha256,
            bytes=upload.size,
            file=upload.name,
            motor=motor,
            bench=bench,
        )

    def all(self, caller: Caller) -> Sequence[PendingRow]:
        """Pending runs in the order of upload."""
        query = select(PendingRow).where(PendingRow.workspace == caller.workspace)
        with self._database.reading() as session:
            return session.scalars(query.order_by(PendingRow.created_at, PendingRow.id)).all()

    def known(self, caller: Caller, rows: Sequence[PendingRow]) -> set[str]:
        """IDs of pending runs whose file and mapping are those of a run or of an earlier one."""
        files = {row.sha256 for row in rows}
        stored = select(RunRow.sha256, RunRow.mapping_sha256).where(
            RunRow.workspace == caller.workspace, RunRow.sha256.in_(files)
        )
        pending = select(PendingRow.id, PendingRow.sha256, PendingRow.mapping).where(
            PendingRow.workspace == caller.workspace, PendingRow.sha256.in_(files)
        )
        with self._database.reading() as session:
            before = {tuple(found) for found in session.execute(stored)}
            in_order = pending.order_by(PendingRow.created_at, PendingRow.id)
            waiting = session.execute(in_order).all()
        known = set()
        for run_id, sha256, mapping in waiting:
            content = (sha256, mapping_digest(mapping))
            if content in before:
                known.add(run_id)
            before.add(content)
        return known

    def benches(self, caller: Caller) -> Sequence[str]:
        """Names of the benches with a saved mapping, latest change first."""
        query = select(BenchRow.name).where(BenchRow.workspace == caller.workspace)
        with self._database.reading() as session:
            return session.scalars(query.order_by(BenchRow.changed_at.desc())).all()

    def get(self, caller: Caller, run_id: str) -> PendingRow:
        """Pending run by ID."""
        with self._database.reading() as session:
            return queries.known(session, PendingRow, caller.workspace, run_id)

    def correct(self, caller: Caller, run_id: str, mapping: Mapping[str, Any] | None) -> PendingRow:
        """Examine a pending run with another mapping, and save the mapping for its bench.

        The mapping is kept even if the file cannot be read with it, so that nothing that the user
        selected is lost; only a mapping that reads the file is saved for the bench.
        """
        chosen = None if mapping is None else dict(mapping)
        with self._database.writing() as session:
            row = queries.known(session, PendingRow, caller.workspace, run_id, lock=True)
            row.mapping = chosen
        found = self._examined(row, chosen, is_of_bench=False)
        with self._database.writing() as session:
            row = queries.known(session, PendingRow, caller.workspace, run_id, lock=True)
            if row.mapping != chosen:
                # The user has selected something else meanwhile, which another call examines.
                return row
            row.found = found
            if row.bench and chosen and found["summary"] is not None:
                _save_bench(session, row, chosen)
        return row

    def reopen(self, caller: Caller, run_id: str) -> None:
        """Make a pending run of the file of a stored run, so that its mapping can be corrected.

        The stored run remains: fits refer to it.

        Raises:
            QuotaExceeded: The quota of the workspace does not allow another run of this size.
            FileLost: The file of the run is missing.
            StorageFull: No disk space is left.
        """
        with self._database.reading() as session:
            run = queries.known(session, RunRow, caller.workspace, run_id)
            self._quotas.check_run(session, caller.workspace, run.bytes)
        copy = self._storage.new_incoming()
        try:
            with refused_when_full("run"), open_regular(self._storage.run(run_id)) as file:
                with copy.open("xb") as target:
                    shutil.copyfileobj(file, target)
        except FileNotFoundError as error:
            raise FileLost(
                f"the stored file {run.file} ({run_id}) is missing; upload it again"
            ) from error
        found = self._reader.pending(copy, run.file, run.mapping, is_of_bench=False)
        self._keep(
            caller, copy, found, sha256=run.sha256, bytes=run.bytes, file=run.file, motor=run.motor
        )

    def _keep(
        self, caller: Caller, source: Path, found: dict[str, Any], **columns: Any
    ) -> PendingRow:
        row = PendingRow(
            id=new_id("run"),
            workspace=caller.workspace,
            mapping=found["mapping"],
            found=found,
            created_at=time.time(),
            **columns,
        )
        # The file first: a sweep deletes a file without a row.
        with refused_when_full("run"):
            self._storage.keep_run(source, row.id)
        with self._database.writing() as session:
            self._quotas.check_run(session, caller.workspace, row.bytes)
            session.add(row)
        return row

    def relabel(self, caller: Caller, motor: str | None, bench: str | None) -> None:
        """Set motor and bench of all pending runs; the mapping of a new bench is applied."""
        motor, bench = checked_label("motor", motor), checked_label("bench", bench)
        with self._database.reading() as session:
            saved = _mapping_of_bench(session, caller.workspace, bench)
        for pending in self.all(caller):
            found = None
            if saved and pending.bench != bench:
                found = self._examined(pending, saved, is_of_bench=True)
            with self._database.writing() as session:
                row = session.get(PendingRow, pending.id, with_for_update=True)
                if row is None:
                    # Confirmed or discarded meanwhile.
                    continue
                if bench and row.mapping and not saved and row.found["summary"] is not None:
                    # The bench was named after its files were corrected.
                    _save_bench(session, row, row.mapping, bench)
                row.motor, row.bench = motor, bench
                if found is not None:
                    row.mapping, row.found = found["mapping"], found

    def confirm(self, caller: Caller) -> None:
        """Make a run of each pending run that can be read, unless it is known."""
        for pending in self.all(caller):
            if _is_outdated(pending):
                # Another call examines its correction, or has been killed meanwhile.
                with suppress(NotFound, RunRefused):
                    self.correct(caller, pending.id, pending.mapping)
            with self._database.writing() as session:
                # Another call may have relabelled, confirmed or discarded it; its file is then
                # that of a stored run.
                row = session.get(PendingRow, pending.id, with_for_update=True)
                if row is None or row.found["summary"] is None or _is_outdated(row):
                    continue
                content = (caller.workspace, row.sha256, row.mapping)
                is_new = stored_before(session, *content) is None
                session.delete(row)
                if is_new:
                    columns = {name: getattr(row, name) for name in _KEPT}
                    run = new_run(row.found["summary"], *content, **columns)
                    run.role = _taken_role(session, run)
                    session.add(run)
            if not is_new:
                self._storage.remove_run(row.id)

    def discard_all(self, caller: Caller) -> None:
        """Delete all pending runs and their files."""
        for pending in self.all(caller):
            # Another call may have confirmed or discarded it meanwhile.
            with suppress(NotFound):
                self.discard(caller, pending.id)

    def discard(self, caller: Caller, run_id: str) -> None:
        """Delete a pending run and its file."""
        with self._database.writing() as session:
            session.delete(queries.known(session, PendingRow, caller.workspace, run_id, lock=True))
        self._storage.remove_run(run_id)

    def _examined(
        self, row: PendingRow, mapping: Mapping[str, Any] | None, *, is_of_bench: bool
    ) -> dict[str, Any]:
        return self._reader.pending(
            self._storage.run(row.id), row.file, mapping, is_of_bench=is_of_bench
        )


def _is_outdated(row: PendingRow) -> bool:
    """True if a pending run was examined with an earlier mapping than its own."""
    return bool(row.found["mapping"] != row.mapping)


def _taken_role(session: Session, run: RunRow) -> str | None:
    """Role that a run takes from an earlier run of the same file, whose mapping it corrects."""
    query = select(RunRow).filter_by(workspace=run.workspace, sha256=run.sha256, motor=run.motor)
    taken = None
    for earlier in session.scalars(query.with_for_update()):
        if earlier.role:
            taken, earlier.role = earlier.role, ""
    return taken


def _mapping_of_bench(session: Session, workspace: str, bench: str | None) -> dict[str, Any] | None:
    saved = None if bench is None else session.get(BenchRow, (workspace, bench))
    return None if saved is None else saved.mapping


def _save_bench(
    session: Session, row: PendingRow, mapping: dict[str, Any], bench: str | None = None
) -> None:
    session.merge(
        BenchRow(
            workspace=row.workspace,
            name=bench or row.bench,
            mapping=mapping,
            changed_at=time.time(),
        )
    )
