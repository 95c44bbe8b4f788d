"""Choice of the runs of a fit: roles, motor names, and what the chosen runs can identify.

A validation run is predicted by a model of the training runs.  The prediction says most about the
model if it is an interpolation, so the run is proposed whose removal narrows the ranges of the
training runs least.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import select

from app import queries
from app.access.service import Caller
from app.database import Database
from app.errors import FieldRefused
from app.runs.reading import RunReader
from app.storage import Storage
from app.tables import RunRow
from app.texts import check_text, checked_label

__all__ = ["ROLES", "RunChoice", "corrected", "proposed_roles"]

ROLES: Final = ("training", "validation")

_VALIDATION = re.compile(r"(?<![a-z])(valid|val(?![a-z])|test|holdout|check)", re.IGNORECASE)
_FEWEST = 3
"""Smallest number of runs of which one is set apart; with two, each has half of the information."""
_MOST_KEPT = 100


class RunChoice:
    """Operations on the chosen runs; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have.
    """

    def __init__(self, database: Database, storage: Storage, reader: RunReader) -> None:
        self._database = database
        self._storage = storage
        self._reader = reader
        self._previews: dict[tuple[tuple[str, str, str], ...], dict[str, Any]] = {}

    def roles(self, runs: Sequence[RunRow]) -> tuple[dict[str, str], bool]:
        """Role of each run by ID, empty if unused, and whether this is only a proposal.

        The runs are those of one motor, newest first.
        """
        if all(run.role is None for run in runs):
            return proposed_roles(list(reversed(runs))), True
        return {run.id: run.role or "" for run in runs}, False

    def set_roles(self, caller: Caller, roles: Mapping[str, str]) -> None:
        """Store the role of each run, by ID; an empty role leaves the run out.

        Raises:
            FieldRefused: A role is unknown.
        """
        for run_id, role in roles.items():
            if role not in ("", *ROLES):
                raise FieldRefused(f"role is {role!r}; expected {' or '.join(ROLES)}", run_id)
        with self._database.writing() as session:
            for run_id, role in roles.items():
                queries.known(session, RunRow, caller.workspace, run_id, lock=True).role = role

    def by_pattern(self, runs: Sequence[RunRow], pattern: str) -> dict[str, str]:
        """Roles in which the files that match a pattern validate and all others train.

        The pattern is a part of the file name, or has ``*`` and ``?``.

        Raises:
            FieldRefused: The pattern is empty or not printable.
        """
        check_text("pattern", pattern, 200)
        if not pattern.strip():
            raise FieldRefused("pattern: expected a part of a file name, such as val", "pattern")
        wanted = pattern.strip().casefold()
        wanted = wanted if set(wanted) & set("*?") else f"*{wanted}*"
        return {run.id: ROLES[fnmatch.fnmatchcase(run.file.casefold(), wanted)] for run in runs}

    def rename(self, caller: Caller, run_id: str, motor: str | None) -> None:
        """Set the motor of a run."""
        motor = checked_label("motor", motor)
        with self._database.writing() as session:
            queries.known(session, RunRow, caller.workspace, run_id, lock=True).motor = motor

    def motors(self, caller: Caller) -> list[str]:
        """Names of all motors that have runs."""
        query = select(RunRow.motor).where(RunRow.workspace == caller.workspace).distinct()
        with self._database.reading() as session:
            return sorted(motor for motor in session.scalars(query) if motor)

    def prospects(self, caller: Caller, run_ids: Sequence[str]) -> dict[str, Any]:
        """Preview of several training runs: contradictions, excitation, and precision to expect."""
        with self._database.reading() as session:
            rows = [queries.known(session, RunRow, caller.workspace, each) for each in run_ids]
        key = tuple((row.sha256, row.file, repr(row.mapping)) for row in rows)
        if key not in self._previews:
            files = [(self._storage.run(row.id), row.file, row.mapping) for row in rows]
            found = self._reader.preview(*files)
            while len(self._previews) >= _MOST_KEPT:
                self._previews.pop(next(iter(self._previews)))
            # Equal content has an equal preview, also of runs that were deleted and stored again.
            self._previews[key] = found
        return self._previews[key]


def corrected(runs: Sequence[RunRow]) -> set[str]:
    """IDs of runs of which a later run has the same file with another mapping."""
    latest = {run.sha256: run.id for run in runs}
    return {run.id for run in runs} - set(latest.values())


def proposed_roles(runs: Sequence[RunRow]) -> dict[str, str]:
    """Role of each run by ID: by its file name, or else the least extreme run validates.

    The runs are those of one motor in the order of recording.  Runs that were corrected have none.
    """
    earlier = corrected(runs)
    if earlier:
        others = [run for run in runs if run.id not in earlier]
        return dict.fromkeys(earlier, "") | proposed_roles(others)
    named = {run.id for run in runs if _VALIDATION.search(run.file)}
    if not named or len(named) == len(runs):
        named = set()
        if len(runs) >= _FEWEST:
            # The latest of equals, as if the motor were predicted after the others were recorded.
            named = {min(reversed(runs), key=lambda run: _narrowing(run, runs)).id}
    return {run.id: ROLES[run.id in named] for run in runs}


def _narrowing(run: RunRow, runs: Sequence[RunRow]) -> float:
    """Relative loss of range of all channels if the run is removed, 0 to the number of channels."""
    others = [other for other in runs if other is not run]
    return sum(1.0 - _width(others, name) / (_width(runs, name) or 1.0) for name in run.channels)


def _width(runs: Sequence[RunRow], name: str) -> float:
    found: list[Mapping[str, float]] = [r.channels[name] for r in runs if name in r.channels]
    if not found:
        return 0.0
    return max(entry["max"] for entry in found) - min(entry["min"] for entry in found)
