"""Results of the fits of a batch as rows of a table.

A batch can have a thousand results, which the table and the page each read in full.  They are
cached, because a result never changes once its fit has succeeded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from app.fits.outputs import read_result
from app.storage import Storage
from app.tables import FitRow
from app.texts import moment
from identification.fleet.refit import Refit, compared_with, refit_of

__all__ = ["MISSING", "refits_of"]

MISSING = "its result is missing or damaged in the data directory"
"""Error text of a succeeded fit whose result cannot be read."""

_UNNAMED = "unnamed motor"
_MOST_KEPT = 4000


def refits_of(
    storage: Storage, fits: Sequence[FitRow], earlier: Mapping[str, FitRow]
) -> list[Refit]:
    """Rows of the table, each compared with the previous fit of its motor."""
    refits = []
    for row in fits:
        before = earlier.get(row.motor) if row.motor and row.status == "succeeded" else None
        previous = None if before is None else _refit(storage, before)
        refits.append(compared_with(_refit(storage, row), previous))
    return refits


def _refit(storage: Storage, row: FitRow) -> Refit:
    motor = row.motor or _UNNAMED
    if row.status == "succeeded":
        try:
            refit = _read(storage.attempt(row.id, row.attempt))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # The last four: malformed content of a result that has no checksum.
            refit = Refit(motor, row.status, error=MISSING)
    else:
        refit = Refit(motor, row.status, error=str((row.error or {}).get("detail", "")))
    return replace(
        refit,
        motor=motor,
        type=row.motor_type or "",
        status=row.status,
        fit=row.id,
        ended_at=None if row.ended_at is None else moment(row.ended_at),
        link=f"/fits/{row.id}",
    )


@lru_cache(maxsize=_MOST_KEPT)
def _read(directory: Path) -> Refit:
    return refit_of("", "", read_result(directory))
