"""Request and response schemas of analyses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StringConstraints

from app.analyses.prediction import Prediction
from app.analyses.service import LoopAnalysis
from app.fits.schemas import Finite, Word
from app.texts import Documented, Received, with_example

__all__ = [
    "DesignIn",
    "DesignOut",
    "ErrorOut",
    "FeedbackIn",
    "FeedbackOut",
    "PredictionOut",
    "StepOut",
    "TuningIn",
    "TuningOut",
]

_MOST = 5
Points = Annotated[list[float], BeforeValidator(list)]
"""Values of a curve, from an array."""


class FeedbackIn(Received):
    """Controllers and temperatures of the speed loop."""

    model_config = with_example({"controllers": ["PI:2,0.5"], "temperatures": [25.0, 80.0]})

    controllers: list[Word] = Field(min_length=1, max_length=_MOST)
    """`P:kp`, `PI:kp,ki` or `PID:kp,ki,kd`, gains in V s/rad."""
    temperatures: list[Finite] = Field(default=[25.0, 125.0], min_length=1, max_length=_MOST)
    """Temperatures of winding and magnet [degC]."""


class TuningIn(Received):
    """Specification of the speed loop."""

    model_config = with_example(
        {
            "specification": {"rise_time": 0.02, "overshoot": 10, "voltage": 24, "current": 8},
            "kinds": ["PI"],
            "temperatures": [0.0, 120.0],
        }
    )

    specification: dict[Annotated[str, StringConstraints(max_length=30)], Finite] = Field(
        max_length=20
    )
    """Requirements and drive, as `motorid tune --spec` takes them, in SI units, %, dB and
    degrees."""
    kinds: list[Literal["P", "PI", "PI+FF", "PID"]] = Field(
        default=["PI"], min_length=1, max_length=4
    )
    """Kinds of controllers to tune."""
    controllers: list[Word] = Field(default=[], max_length=_MOST)
    """Controllers to judge instead."""
    temperatures: list[Finite] = Field(default=[25.0, 125.0], min_length=1, max_length=_MOST)
    """Temperatures of winding and magnet [degC]."""
    probability: float = Field(default=0.95, gt=0, le=1)
    """Fraction of the draws that shall meet it [-]."""
    step: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    """Step of the reference [rad/s]; null: half the speed that the limits allow."""

    def options(self) -> dict[str, Any]:
        """Arguments of the service; each kind once."""
        return self.model_dump() | {"kinds": tuple(dict.fromkeys(self.kinds))}


class TuningOut(Documented):
    """Controllers and their judgement."""

    tuning: Mapping[str, Any]
    """Content of the file of `motorid tune`."""
    remarks: list[str]
    """Limits of the numbers, in words."""


class StepOut(Documented):
    """Step response of one controller at one temperature: speed over reference."""

    controller: str
    temperature_degC: float  # noqa: N815
    time_s: Points = Field(validation_alias="time")
    """Time after the step [s]."""
    q05: Points
    """Lower end of the pointwise 90 % band [-]."""
    median: Points
    """Pointwise median [-]."""
    q95: Points
    """Upper end of the pointwise 90 % band [-]."""


class FeedbackOut(Documented):
    """Metrics and step responses of the speed loop."""

    feedback: list[Mapping[str, Any]]
    """Member `feedback` of result.json for these controllers and temperatures."""
    steps: list[StepOut]
    remarks: list[str]
    """Limits of the numbers, in words."""

    @classmethod
    def of(cls, loop: LoopAnalysis) -> FeedbackOut:
        """Build the schema from an analysis."""
        return cls.model_validate(loop, from_attributes=True)


class ErrorOut(Documented):
    """Simulation error of one channel, as in result.json."""

    rmse: float | None
    """Root mean square error [A] or [rad/s]."""
    nrmse: float | None
    """RMSE over the standard deviation of the measured channel [-]."""
    noise_ratio: float | None
    """RMSE over the noise of the fit [-]."""


class PredictionOut(Documented):
    """Comparison of a run with its simulation."""

    run: str
    declared: bool
    """True if the nominal model was used."""
    rows: int
    errors: dict[str, ErrorOut]
    """For `current` and `speed`."""
    remarks: list[str]
    """Limits of the numbers, in words."""
    links: dict[str, str]
    """`table` is the simulation as CSV."""

    @classmethod
    def of(cls, fit_id: str, run_id: str, declared: bool, prediction: Prediction) -> PredictionOut:
        """Build the schema from a prediction."""
        query = "?declared=true" if declared else ""
        own = f"/api/v1/fits/{fit_id}/predictions/{run_id}"
        return cls(
            run=run_id,
            declared=declared,
            rows=prediction.rows,
            errors={name: ErrorOut(**found) for name, found in prediction.errors.items()},
            remarks=list(prediction.remarks),
            links={"self": f"{own}{query}", "table": f"{own}.csv{query}"},
        )


class DesignIn(Received):
    """Motor and options of a designed run."""

    model_config = with_example({"fit": "fit_0123456789abcdef", "limits": {"current": 8.0}})

    fit: Annotated[str, StringConstraints(max_length=60)] | None = None
    """ID of a succeeded fit."""
    nameplate: Annotated[str, StringConstraints(max_length=500)] | None = None
    """In place of a fit: nameplate, `KEY=VALUE,...`."""
    limits: dict[Annotated[str, StringConstraints(max_length=20)], float] = Field(
        default={}, max_length=_MOST
    )
    """Largest `voltage` [V], `current` [A], `speed` [rad/s], `slew` [V/s], `position` [rad] and
    `load` [N m]; by default voltage, current and speed of the earlier runs, and no load."""
    duration: float | None = None
    """Duration [s]."""
    rate: float | None = None
    """Sample rate [Hz]."""
    temperatures: list[Finite] = Field(default=[], max_length=_MOST)
    """Temperatures that the bench can hold [degC]; the best one is proposed."""
    narrow: Word = ""
    """Quantity to narrow, such as `Ra25` or `rise_time_s@125`."""
    seed: int = Field(default=0, ge=0, lt=2**32)

    def options(self) -> dict[str, Any]:
        """Fields of `DesignOptions`."""
        limits = ",".join(f"{name}={value!r}" for name, value in self.limits.items())
        fields = self.model_dump(exclude={"fit", "nameplate"})
        return fields | {"limits": (limits,) if limits else ()}


class DesignOut(Documented):
    """Designed run and its expected gain."""

    design: Mapping[str, Any]
    """Expected gain, as `motorid design` writes it to FILE.json."""
    table: str
    """Samples as CSV: `time_s,voltage_V,temperature_degC`, and `load_Nm` if a load is allowed."""
