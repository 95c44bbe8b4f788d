"""Request and response schemas of fits."""

from __future__ import annotations

import time
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, StringConstraints

from app.fits.request import FitRequest
from app.fits.service import StoredFit
from app.tables import FitRow
from app.texts import Documented, Moment, Received, with_example
from identification.label import LONGEST_LABEL
from identification.options import EffortName, FitOptions

__all__ = [
    "Finite",
    "FitCreate",
    "FitError",
    "FitEvent",
    "FitList",
    "FitOptionsIn",
    "FitOut",
    "FitRuns",
    "FitSummary",
    "Motor",
    "Progress",
    "Status",
    "Word",
]

Status = Literal["queued", "running", "succeeded", "failed", "cancelled"]
RunId = Annotated[
    str, StringConstraints(max_length=60), Field(examples=["run_n2dq4hoyzmxrj6tcf7k3wvb5ea"])
]
Motor = Annotated[str, StringConstraints(max_length=200)]
Word = Annotated[str, StringConstraints(max_length=100)]
Finite = Annotated[float, Field(allow_inf_nan=False)]

_DEFAULT = FitOptions()
_FORESEEABLE = 0.05
"""Completed fraction from which the time so far predicts the remaining time."""
_FIT: dict[str, Any] = {
    "id": "fit_k5x2qv7wr3m4hd6ytnobczs5fi",
    "status": "succeeded",
    "progress": {"stage": "done", "fraction": 1.0},
    "motor": "bench 4, motor 17",
    "training": ["run_n2dq4hoyzmxrj6tcf7k3wvb5ea"],
    "validation": [],
    "options": {
        "seed": 0,
        "posterior": True,
        "effects": True,
        "hold": "auto",
        "temperatures": [25.0, 125.0],
        "controllers": ["P:1"],
        "set_aside": False,
        "force": False,
    },
    "attempt": 1,
    "batch": "batch_q4m6zt2hxk5dyw3rbn7vcjosae",
    "links": {"self": "/api/v1/fits/fit_k5x2qv7wr3m4hd6ytnobczs5fi"},
    "created_at": "2026-11-21T12:00:00.000000Z",
    "started_at": "2026-11-21T12:00:00.120000Z",
    "ended_at": "2026-11-21T12:00:30.250000Z",
}


class FitOptionsIn(Documented):
    """Options of a fit that a caller can set."""

    model_config = ConfigDict(extra="forbid", strict=True)

    seed: int = Field(default=_DEFAULT.seed, ge=0, lt=2**32)
    """Seed of the sampler."""
    posterior: bool = _DEFAULT.posterior
    """True to sample the posterior; otherwise intervals come from the covariance of the fit."""
    effects: bool = _DEFAULT.effects
    """True to search for effects beyond the nominal model."""
    hold: Literal["auto", "zoh", "foh"] = _DEFAULT.hold
    """Voltage between samples: zero-order hold, first-order hold, or `auto` (the data decide)."""
    temperatures: list[Finite] = Field(
        default=list(_DEFAULT.temperatures), min_length=1, max_length=20
    )
    """Temperatures of the feedback metrics [degC]."""
    controllers: list[Word] = Field(
        default=list(_DEFAULT.controllers),
        min_length=1,
        max_length=20,
        examples=[["P:1", "PI:2,0.5"]],
    )
    """Controllers of the feedback metrics: `P:kp`, `PI:kp,ki`, `PID:kp,ki,kd`."""
    effort: EffortName = _DEFAULT.effort
    """Limit of the computation; the result of a level is the same on any machine."""
    time_limit: float | None = Field(default=_DEFAULT.time_limit, gt=0.0, allow_inf_nan=False)
    """Time after which the fit stops with its current result [s]; the result then depends on the
    machine."""
    set_aside: bool = _DEFAULT.set_aside
    """True if runs that contradict physics or the other runs are excluded."""
    force: bool = _DEFAULT.force
    """True to fit contradictory runs; the result is marked."""
    known: list[Word] = Field(
        default=list(_DEFAULT.known), max_length=7, examples=[["Kt25=0.048+-5%", "L=2.9e-3"]]
    )
    """Known values of parameters, `NAME=VALUE`, `NAME=VALUE+-SD` or `NAME=VALUE+-N%`, in SI units;
    default standard deviation 1 %."""
    nameplate: str = Field(
        default=_DEFAULT.nameplate,
        max_length=500,
        examples=["voltage=12,no_load_speed=3000rpm,no_load_current=0.1,stall_current=4.2"],
    )
    """Nameplate data, `KEY=VALUE` separated by commas, in SI units or with a unit after the
    number."""
    bench: str = Field(default="", max_length=LONGEST_LABEL, examples=["bench 4"])
    """Name of the test bench, for report and result."""

    def content(self) -> dict[str, Any]:
        """Options to store; requests from before `bench` existed have none."""
        return self.model_dump(mode="json", exclude=None if self.bench else {"bench"})


class FitRuns(Received):
    """Runs of a fit by role, and the name of their motor."""

    training: list[RunId] = Field(min_length=1, max_length=200)
    """Training runs in the order of recording."""
    validation: list[RunId] = Field(default=[], max_length=200)
    """Validation runs; they are never fitted."""
    motor: Motor | None = None
    """Name of the motor; null: that of the runs, if all of them have the same."""

    def request(self, options: FitOptionsIn, motor_type: str | None = None) -> FitRequest:
        """Convert to the request that the service takes."""
        content = options.content()
        return FitRequest(self.training, self.validation, content, self.motor, motor_type)


class FitCreate(FitRuns):
    """Request for a fit."""

    model_config = with_example(
        {
            "training": ["run_n2dq4hoyzmxrj6tcf7k3wvb5ea"],
            "validation": ["run_7rjv5dwq2kx6zbh3mtyo4ncpfa"],
            "options": {"seed": 1, "controllers": ["P:1"]},
            "motor": "bench 4, motor 17",
        }
    )

    options: FitOptionsIn = Field(default_factory=FitOptionsIn)


class Progress(Documented):
    """Progress of a fit."""

    stage: str
    fraction: float = Field(ge=0.0, le=1.0)
    """Completed fraction, 0 to 1."""
    remaining_s: float | None = None
    """Estimated time to the end, from the time so far [s]; null before a twentieth is done and
    unless the fit is running."""

    @classmethod
    def of(cls, row: FitRow, now: float) -> Progress:
        """Progress of a fit at a time [s since 1970]."""
        remaining = None
        if row.status == "running" and row.started_at and row.fraction >= _FORESEEABLE:
            elapsed = max(0.0, now - row.started_at)
            remaining = round(elapsed * (1.0 - row.fraction) / row.fraction, 1)
        return cls(stage=row.stage, fraction=row.fraction, remaining_s=remaining)


class FitError(Documented):
    """Reason why a fit failed."""

    code: str
    """Stable identifier for scripts."""
    detail: str
    file: str | None = None
    row: int | None = None
    column: str | None = None
    findings: list[dict[str, Any]] | None = None
    """With the code `contradictory_runs`: each contradiction with file, column, statistic, limit
    and corrections."""


class FitSummary(Documented):
    """A fit without its result."""

    model_config = with_example(_FIT)

    id: str
    status: Status
    progress: Progress
    motor: str | None
    training: list[str]
    validation: list[str]
    options: dict[str, Any]
    attempt: int
    """Number of attempts so far."""
    error: FitError | None = None
    """Reason of a failure, else null."""
    batch: str | None
    """ID of its batch, else null."""
    links: dict[str, str]
    created_at: Moment
    """UTC, ISO 8601."""
    started_at: Moment | None
    ended_at: Moment | None

    @classmethod
    def of(cls, fit: StoredFit) -> FitSummary:
        """Build the schema from a stored fit."""
        return cls.model_validate(_fields(fit))


class FitOut(FitSummary):
    """A fit with its result if it has succeeded."""

    model_config = with_example(_FIT | {"result": {"schema_version": 1}})

    result: dict[str, Any] | None
    """Content of result.json after success, else null."""

    @classmethod
    def of(cls, fit: StoredFit) -> FitOut:
        return cls.model_validate(_fields(fit) | {"result": fit.result})


class FitList(Documented):
    """A page of fits, newest first, without their results."""

    items: list[FitSummary]
    next: str | None
    """Value of `after` for the next page; null on the last page."""


class FitEvent(Documented):
    """Content of a progress event."""

    id: str
    status: Status
    progress: Progress
    attempt: int
    error: FitError | None

    @classmethod
    def of(cls, row: FitRow) -> FitEvent:
        """Build the event from the database row of a fit."""
        return cls.model_validate(_columns(row, "id", "status", "attempt", "error"))


def _fields(fit: StoredFit) -> dict[str, Any]:
    row = fit.row
    own = f"/api/v1/fits/{row.id}"
    links = {"self": own, "events": f"{own}/events"}
    if row.status == "succeeded":
        links["report"] = f"{own}/report"
        if fit.has_posterior:
            links["posterior"] = f"{own}/posterior"
    own_columns = ("id", "status", "motor", "options", "attempt", "error")
    return _columns(row, *own_columns, "created_at", "started_at", "ended_at") | {
        "training": list(fit.training),
        "validation": list(fit.validation),
        "batch": row.batch_id,
        "links": links,
    }


def _columns(row: FitRow, *names: str) -> dict[str, Any]:
    """Columns of a fit by name, and its progress."""
    return {name: getattr(row, name) for name in names} | {
        "progress": Progress.of(row, time.time())
    }
