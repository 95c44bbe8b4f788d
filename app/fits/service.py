"""Fit service: submit, list, cancel and delete fits, and read their outputs."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

from sqlalchemy.orm import Session

from app import queries
from app.access.quotas import Quotas
from app.access.service import Caller
from app.database import Database
from app.errors import FileLost, NotReady
from app.fits import repository
from app.fits.exports import exported
from app.fits.outputs import expected_outputs, open_output, read_result
from app.fits.request import FitRequest, check_runs, checked_key, new_row
from app.fits.supervisor import Supervisor
from app.storage import Storage
from app.tables import FitRow

__all__ = ["FitService", "StoredFit"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StoredFit:
    """A fit with its derived data."""

    row: FitRow
    training: Sequence[str]
    """IDs of its training runs, in order."""
    validation: Sequence[str]
    has_posterior: bool = False
    result: dict[str, Any] | None = None
    """Content of result.json if the fit has succeeded and the result was requested."""


class FitService:
    """Operations on fits; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have, `NotReady` for an output that
    a fit does not have, or not yet, and `FileLost` for one that is missing or damaged.
    """

    def __init__(
        self, database: Database, storage: Storage, supervisor: Supervisor, quotas: Quotas
    ) -> None:
        self._quotas = quotas
        self._database = database
        self._storage = storage
        self._supervisor = supervisor

    def create(self, caller: Caller, request: FitRequest, idempotency_key: str | None) -> StoredFit:
        """Submit a fit, which is queued and computed in the background.

        A request without a motor is for the motor to which all of its runs belong.

        The same key with the same request returns the same fit, however often it is sent.

        Raises:
            NotFound: A run is not in the caller's workspace.
            FieldRefused: The runs or the key are invalid.
            OptionError: An option is invalid.
            KeyReused: The key was used before with a different request.
            WaitingQuota: The workspace has reached its quota of waiting fits.
        """
        key = checked_key(idempotency_key)
        row = new_row(caller, request)
        row.idempotency_key = key

        def add(session: Session) -> None:
            (motor,) = check_runs(session, caller, request)
            row.motor = row.motor or motor
            self._quotas.check_fits(session, caller.workspace, 1)
            repository.add(session, (row, request))

        stored = queries.requested_once(self._database, row, add)
        if stored is not row:
            return self.get(caller, stored.id)
        _log.info("fit accepted", extra={"fit": row.id, "runs": len(request.training)})
        self._supervisor.wake()
        return StoredFit(row, request.training, request.validation)

    def page(
        self, caller: Caller, *, after: str | None, limit: int, **equal: str | None
    ) -> tuple[list[StoredFit], str | None]:
        """Page of fits, newest first, and the cursor of the next page, if any.

        `equal` are values of `status` and `motor`, of which None selects all.
        """
        with self._database.reading() as session:
            rows, following = queries.page(
                session, FitRow, caller.workspace, after=after, limit=limit, **equal
            )
            ids = repository.run_ids(session, [row.id for row in rows])
        return [self._fit(row, ids[row.id]) for row in rows], following

    def get(self, caller: Caller, fit_id: str) -> StoredFit:
        """Fit with its result if it has succeeded."""
        with self._database.reading() as session:
            row = queries.known(session, FitRow, caller.workspace, fit_id)
            ids = repository.run_ids(session, [row.id])[row.id]
        result = None
        if row.status == "succeeded":
            try:
                result = read_result(self._directory(row))
            except OSError as error:
                raise self._lost(caller, row, "result.json", error) from error
        fit = self._fit(row, ids, result)
        if result is not None and not fit.has_posterior:
            # If the fit was deleted after its result was read, this raises NotFound.
            self.row(caller, fit_id)
        return fit

    def row(self, caller: Caller, fit_id: str) -> FitRow:
        """Database row of a fit: its state and progress."""
        with self._database.reading() as session:
            return queries.known(session, FitRow, caller.workspace, fit_id)

    def delete(self, caller: Caller, fit_id: str, *, remove: bool = True) -> StoredFit | None:
        """Cancel an unfinished fit and return it, or delete an ended one and return None.

        Without `remove`, an ended fit is returned as it is.
        """
        with self._database.writing() as session:
            queries.known(session, FitRow, caller.workspace, fit_id)
            is_cancelled = repository.cancel(session, fit_id, time.time())
            if remove and not is_cancelled:
                repository.remove(session, fit_id)
        if is_cancelled:
            # The supervisor kills a running attempt and deletes its files.
            self._storage.remove_checkpoints(fit_id)
            self._supervisor.wake()
        if is_cancelled or not remove:
            return self.get(caller, fit_id)
        self._storage.remove_fit(fit_id)
        return None

    def output(
        self, caller: Caller, fit_id: str, name: Literal["report.html", "posterior.nc"]
    ) -> BinaryIO:
        """Open an output of a fit for reading."""
        row = self._succeeded(caller, fit_id)
        directory = self._directory(row)
        try:
            return open_output(directory, name)
        except OSError as error:
            lost = self._lost(caller, row, name, error)
            is_missing = isinstance(error, FileNotFoundError) and directory.is_dir()
            if not is_missing or name in expected_outputs(directory):
                raise lost from error
            raise NotReady(
                f"{fit_id} has no posterior; repeat the fit with the option `posterior` true"
            ) from None

    def export(
        self, caller: Caller, fit_id: str, form: str, temperatures: Sequence[float]
    ) -> bytes:
        """Result of a fit in the format of another program.

        Raises:
            FieldRefused: The format, a temperature or the result is not accepted.
            Unavailable: The export failed or took too long.
        """
        row = self._succeeded(caller, fit_id)
        directory = self._directory(row)
        try:
            for name in sorted(expected_outputs(directory) - {"report.html"}):
                open_output(directory, name).close()
        except OSError as error:
            raise self._lost(caller, row, "result.json", error) from error
        return exported(directory, form, temperatures)

    def _succeeded(self, caller: Caller, fit_id: str) -> FitRow:
        row = self.row(caller, fit_id)
        if row.status != "succeeded":
            raise NotReady(f"the fit {fit_id} is {row.status}; only a succeeded fit has outputs")
        return row

    def _fit(
        self, row: FitRow, ids: Mapping[str, Sequence[str]], result: dict[str, Any] | None = None
    ) -> StoredFit:
        has = row.status == "succeeded" and (self._directory(row) / "posterior.nc").is_file()
        return StoredFit(row, ids["training"], ids["validation"], has, result)

    def _directory(self, row: FitRow) -> Path:
        return self._storage.attempt(row.id, row.attempt)

    def _lost(self, caller: Caller, row: FitRow, name: str, error: OSError) -> FileLost:
        """Error for an output that cannot be read; raise `NotFound` if the fit was deleted."""
        # A fit is deleted before its files, so a missing file may mean a deleted fit.
        self.row(caller, row.id)
        state = f"is damaged ({error.strerror})"
        if isinstance(error, FileNotFoundError):
            state = "is not in the data directory"
        _log.error("stored file lost", extra={"fit": row.id, "file": name, "reason": str(error)})
        return FileLost(
            f"the {name} of {row.id} {state}; repeat the fit, or ask the operator to restore "
            "a backup"
        )
