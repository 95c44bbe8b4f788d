"""Request and response schemas of batches."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from app.batches import MOST_MOTORS
from app.batches.service import StoredBatch
from app.fits.repository import ENDED
from app.fits.request import FitRequest
from app.fits.schemas import FitError, FitOptionsIn, FitRuns, Motor, Progress, Status
from app.texts import Documented, Moment, Received, with_example

__all__ = ["BatchCreate", "BatchList", "BatchOut", "BatchResults", "BatchSummary"]


class BatchItem(FitRuns):
    """One motor of a batch."""

    type: Motor | None = None
    """Type of the motor; the results of motors of one type are pooled."""
    options: FitOptionsIn | None = None
    """Options of this motor; default: those of the batch."""


class BatchCreate(Received):
    """Request for a batch of fits."""

    model_config = with_example(
        {
            "name": "November refit",
            "options": {"posterior": False},
            "motors": [
                {
                    "motor": "motor 17",
                    "type": "RE40",
                    "training": ["run_n2dq4hoyzmxrj6tcf7k3wvb5ea"],
                },
                {
                    "motor": "motor 18",
                    "type": "RE40",
                    "training": ["run_7rjv5dwq2kx6zbh3mtyo4ncpfa"],
                },
            ],
        }
    )

    motors: list[BatchItem] = Field(min_length=1, max_length=MOST_MOTORS)
    options: FitOptionsIn = Field(default_factory=FitOptionsIn)
    """Options of each motor without its own."""
    name: Motor | None = None
    """Name in lists."""

    def requests(self) -> list[FitRequest]:
        """One fit request per motor."""
        return [item.request(item.options or self.options, item.type) for item in self.motors]


class BatchFit(Documented):
    """One motor of a batch, with the state of its fit."""

    fit: str
    """ID of the fit; GET /api/v1/fits/{id} returns its result."""
    motor: str | None
    type: str | None = None
    """Type of the motor, as requested."""
    status: Status
    progress: Progress
    error: FitError | None = None


class BatchProgress(Documented):
    """Progress of a batch."""

    fraction: float = Field(ge=0.0, le=1.0)
    """Completed fraction, 0 to 1."""
    ended: int
    """Number of fits in a final state."""
    total: int
    """Number of all fits."""


class BatchSummary(Documented):
    """A batch without its fits."""

    id: str
    name: str | None
    status: Literal["queued", "running", "succeeded", "partial", "failed", "cancelled"]
    """`partial`: all fits have ended, and some but not all have succeeded."""
    progress: BatchProgress
    counts: dict[Status, int]
    """Number of fits in each state."""
    links: dict[str, str]
    created_at: Moment
    """UTC, ISO 8601."""

    @classmethod
    def of(cls, batch: StoredBatch) -> BatchSummary:
        """Build the schema from a stored batch."""
        return cls.model_validate(_fields(batch))


class BatchOut(BatchSummary):
    """A batch with its fits."""

    model_config = with_example(
        {
            "id": "batch_q4m6zt2hxk5dyw3rbn7vcjosae",
            "name": "November refit",
            "status": "running",
            "progress": {"fraction": 0.05, "ended": 0, "total": 2},
            "counts": {"queued": 1, "running": 1},
            "links": {
                "self": "/api/v1/batches/batch_q4m6zt2hxk5dyw3rbn7vcjosae",
                "results": "/api/v1/batches/batch_q4m6zt2hxk5dyw3rbn7vcjosae/results",
                "report": "/api/v1/batches/batch_q4m6zt2hxk5dyw3rbn7vcjosae/report",
            },
            "created_at": "2026-11-21T12:00:00.000000Z",
            "fits": [
                {
                    "fit": "fit_k5x2qv7wr3m4hd6ytnobczs5fi",
                    "motor": "motor 17",
                    "type": "RE40",
                    "status": "running",
                    "progress": {"stage": "fit", "fraction": 0.1},
                    "error": None,
                }
            ],
        }
    )

    fits: list[BatchFit]

    @classmethod
    def of(cls, batch: StoredBatch) -> BatchOut:
        listed = [
            {
                "fit": fit.id,
                "motor": fit.motor,
                "type": fit.motor_type,
                "status": fit.status,
                "progress": {"stage": fit.stage, "fraction": fit.fraction},
                "error": fit.error,
            }
            for fit in batch.fits
        ]
        return cls.model_validate(_fields(batch) | {"fits": listed})


class BatchResults(Documented):
    """Results of a batch, one row per motor."""

    model_config = with_example(
        {
            "id": "batch_q4m6zt2hxk5dyw3rbn7vcjosae",
            "status": "running",
            "rows": [
                {
                    "motor": "motor 17",
                    "status": "succeeded",
                    "Ra25": 0.5903,
                    "Ra25_sd": 0.0004,
                    "Ra25_drift_sds": 0.7,
                }
            ],
        }
    )

    id: str
    status: str
    """Status of the batch; rows of unfinished fits are empty."""
    rows: list[dict[str, str | int | float | bool | None]]
    """Rows of the table; docs/batch.md describes the columns."""


class BatchList(Documented):
    """A page of batches, newest first, without their fits."""

    items: list[BatchSummary]
    next: str | None
    """Value of `after` for the next page; null on the last page."""


def _fields(batch: StoredBatch) -> dict[str, Any]:
    own = f"/api/v1/batches/{batch.row.id}"
    total = sum(batch.counts.values())
    ended = sum(number for state, number in batch.counts.items() if state in ENDED)
    return {
        "id": batch.row.id,
        "name": batch.row.name,
        "status": batch.status,
        "progress": {"fraction": batch.fraction, "ended": ended, "total": total},
        "counts": dict(batch.counts),
        "links": {"self": own, "results": f"{own}/results", "report": f"{own}/report"},
        "created_at": batch.row.created_at,
    }
