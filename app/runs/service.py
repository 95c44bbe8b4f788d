"""Run service: store, list and delete runs."""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.exc import IntegrityError, OperationalError
from sqlalchemy.orm import Session

from app import queries
from app.access.quotas import Quotas
from app.access.service import Caller
from app.database import Database
from app.disk import is_full
from app.errors import FieldRefused, QuotaExceeded, RunInUse
from app.identifiers import new_id
from app.metrics import Metrics
from app.runs.reading import RunReader
from app.runs.upload import Upload
from app.storage import Storage, refused_when_full
from app.tables import FitRow, FitRunRow, RunRow
from app.texts import checked_label

__all__ = ["RunService", "mapping_digest", "new_run", "stored_before"]

_MEASURED = ("rows", "sample_rate_hz", "duration_s", "channels", "warnings")
_NOTED_AGAIN_S = 3600.0
_log = logging.getLogger(__name__)


class RunService:
    """Operations on runs; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have.
    """

    def __init__(
        self,
        database: Database,
        storage: Storage,
        reader: RunReader,
        metrics: Metrics,
        quotas: Quotas,
    ) -> None:
        self._quotas = quotas
        self._database = database
        self._storage = storage
        self._reader = reader
        self._metrics = metrics

    def store(self, caller: Caller, upload: Upload) -> tuple[RunRow, bool]:
        """Parse an upload and store it as a run, and return whether it is new.

        The same bytes with the same mapping are the same run.  The file of the upload is moved if
        it becomes a run.

        Raises:
            RunRefused: The file is not a valid run.
            FieldRefused: The name of the motor or the mapping is invalid.
            QuotaExceeded: The quota of the workspace does not allow another run of this size.
            StorageFull: No disk space is left.
        """
        outcome = "refused"
        try:
            row, is_new = self._store(caller, upload)
            outcome = "stored" if is_new else "known"
        finally:
            self._metrics.uploads.labels(outcome).inc()
            self._metrics.uploaded_bytes.inc(upload.size)
        return row, is_new

    def preview(self, upload: Upload) -> dict[str, Any]:
        """Examine an upload without storing it, as `motorid check` does."""
        mapping = _mapping(upload.fields.get("mapping"))
        return self._reader.preview((upload.path, upload.name, mapping))

    def _store(self, caller: Caller, upload: Upload) -> tuple[RunRow, bool]:
        motor = checked_label("motor", upload.fields.get("motor"))
        mapping = _mapping(upload.fields.get("mapping"))
        content = (caller.workspace, upload.sha256, mapping)
        with self._database.reading() as session:
            known = stored_before(session, *content)
            if known is None:
                # Check early to avoid useless work; the check in the write transaction decides.
                self._quotas.check_run(session, caller.workspace, upload.size)
        if known is not None:
            self._restore(known, upload)
            self._note_sent(known)
            return known, False
        with self._metrics.read_seconds.time():
            found = self._reader.read(upload.path, upload.name, mapping)
        row = new_run(
            found, *content, id=new_id("run"), file=upload.name, motor=motor, bytes=upload.size
        )
        # Store the file first: a sweep deletes a file without a row, but a row without a
        # file is a loss.
        with refused_when_full("run"):
            self._storage.keep_run(upload.path, row.id)
        try:
            with self._database.writing() as session:
                self._quotas.check_run(session, caller.workspace, upload.size)
                session.add(row)
        except QuotaExceeded:
            self._storage.remove_run(row.id)
            raise
        except OperationalError as error:
            # After any other error the row may exist, so the file is left to the sweep.
            if is_full(error):
                self._storage.remove_run(row.id)
            raise
        except IntegrityError:
            # A concurrent upload of the same content was committed first.
            self._storage.remove_run(row.id)
            with self._database.reading() as session:
                known = stored_before(session, *content)
            if known is None:
                raise
            return known, False
        _log.info("run stored", extra={"run": row.id, "rows": row.rows, "bytes": row.bytes})
        return row, True

    def _restore(self, row: RunRow, upload: Upload) -> None:
        """Rewrite the file of a run if it is missing or damaged."""
        if self._storage.has_run(row.id, row.bytes, row.sha256):
            return
        with refused_when_full("run"):
            self._storage.keep_run(upload.path, row.id)
        _log.warning("stored run was missing or damaged, and is restored", extra={"run": row.id})

    def _note_sent(self, row: RunRow) -> None:
        """Record a repeated upload of a run, so that the run does not expire."""
        now = time.time()
        if now - (row.sent_at or row.created_at) > _NOTED_AGAIN_S:
            with self._database.writing() as session:
                session.execute(update(RunRow).where(RunRow.id == row.id).values(sent_at=now))

    def page(
        self, caller: Caller, *, after: str | None, limit: int, motor: str | None
    ) -> tuple[Sequence[RunRow], str | None]:
        """Page of runs, newest first, and the cursor of the next page, if any."""
        with self._database.reading() as session:
            return queries.page(
                session, RunRow, caller.workspace, after=after, limit=limit, motor=motor
            )

    def get(self, caller: Caller, run_id: str) -> RunRow:
        """Run by ID."""
        with self._database.reading() as session:
            return queries.known(session, RunRow, caller.workspace, run_id)

    def delete(self, caller: Caller, run_id: str) -> None:
        """Delete a run and its file; raise `RunInUse` while an unfinished fit needs it."""
        with self._database.writing() as session:
            row = queries.known(session, RunRow, caller.workspace, run_id, lock=True)
            unfinished = (
                select(FitRow.id)
                .join(FitRunRow, FitRunRow.fit_id == FitRow.id)
                .where(FitRunRow.run_id == run_id, FitRow.status.in_(("queued", "running")))
                .limit(1)
            )
            fit_id = session.scalars(unfinished).one_or_none()
            if fit_id is not None:
                raise RunInUse(
                    f"{row.file} ({run_id}) is used by the unfinished fit {fit_id}; cancel the fit "
                    "or wait for its end"
                )
            session.delete(row)
        self._storage.remove_run(run_id)


def stored_before(
    session: Session, workspace: str, sha256: str, mapping: Mapping[str, Any] | None
) -> RunRow | None:
    """Run with these bytes and this mapping, or None."""
    query = select(RunRow).filter_by(
        workspace=workspace, sha256=sha256, mapping_sha256=mapping_digest(mapping)
    )
    return session.scalars(query).one_or_none()


def new_run(
    found: Mapping[str, Any],
    workspace: str,
    sha256: str,
    mapping: dict[str, Any] | None,
    **columns: Any,
) -> RunRow:
    """Row of a run with what the reader found in its file, not stored yet."""
    return RunRow(
        workspace=workspace,
        sha256=sha256,
        mapping=mapping,
        mapping_sha256=mapping_digest(mapping),
        created_at=time.time(),
        **columns,
        **{name: found[name] for name in _MEASURED},
    )


def mapping_digest(mapping: Mapping[str, Any] | None) -> str:
    """SHA-256 of a mapping; the same bytes with the same mapping are the same run."""
    text = json.dumps(mapping, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _mapping(text: str | None) -> dict[str, Any] | None:
    """Parse a mapping from JSON; its content is validated when the file is read."""
    if text is None or not text.strip():
        return None
    try:
        mapping = json.loads(text, object_pairs_hook=_without_repeats, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise FieldRefused(f"mapping: not JSON ({str(error)[:80]})", "mapping") from error
    if not isinstance(mapping, dict):
        raise FieldRefused(
            'mapping: expected an object such as {"speed_rad_s": {"column": "n", "unit": "rpm"}}',
            "mapping",
        )
    return mapping or None


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key is repeated in one object")
    return found


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")
