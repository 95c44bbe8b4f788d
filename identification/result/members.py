"""Objects of result.json that hold parameters: quantities, runs, effects and models."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "ABSENT",
    "Correlation",
    "EffectEntry",
    "Fraction",
    "Model",
    "MotorParameters",
    "Nominal",
    "NotNegative",
    "Number",
    "Parameter",
    "Positive",
    "Quantity",
    "Role",
    "ResultObject",
    "RunEntry",
    "Shift",
    "Text",
]

Number = float | None
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Text = Annotated[str, Field(min_length=1)]
Role = Literal["training", "validation"]
_Hold = Literal["zoh", "foh"]
_Voltage = Literal["logged", "smoothed"]

ABSENT: Any = Field(default_factory=lambda: None)
"""Default of a member that may be absent; the schema does not show a default."""


class ResultObject(BaseModel):
    """Object whose members are described by the texts below them; it may have further members."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class Quantity(ResultObject):
    """Posterior of a quantity; q05 to q95 is its equal-tailed 90 % interval."""

    mean: Number
    sd: NotNegative | None
    q05: Number
    median: Number
    q95: Number
    unit: str
    defined_fraction: Fraction = ABSENT
    """Fraction of the draws for which the quantity exists."""
    infinite_fraction: Fraction = ABSENT
    """Fraction of these draws for which the quantity is infinite."""


class Prior(ResultObject):
    """Known value of a parameter."""

    value: float
    sd: Positive
    origin: Literal["--known", "--nameplate"]
    used: bool
    """False if the runs contradict the known value."""
    identified_by_runs: bool
    """True if the runs alone determine the parameter."""


class Parameter(Quantity):
    """Posterior of a parameter."""

    identified: bool
    prior: Prior = ABSENT
    """Known value of the parameter given by the user, if any."""


class MotorParameters(ResultObject):
    """Parameters by name: those of the nominal model, each in its unit, and those of effects."""


class Channel(ResultObject):
    """Column of a run file from which a channel was read."""

    column: str
    unit: str
    scale: Number
    offset: Number
    method: Literal["linear", "hold", "difference", "duty", "constant", "row"] = ABSENT
    """How a channel with a clock of its own was brought to the clock of the run (linear
    interpolation, or hold of the previous value), or how it was derived: difference of the angle
    over each sample interval, duty cycle times bus voltage, the constant `value`, or the number of
    the sample."""
    period: float = ABSENT
    """Change of the cell after which an angle or a counter starts again, if it is mapped."""
    sign: str = ABSENT
    """Column of directions by which the cell is multiplied, if it is mapped."""
    value: float = ABSENT
    """Constant in the unit, in place of a column, if it is mapped."""


class RunEntry(ResultObject):
    """Run as it was read."""

    file: Text
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    role: Role
    rows: Annotated[int, Field(ge=1)]
    sample_rate_hz: Positive | None
    hottest_degC: Number = ABSENT
    """Highest temperature of the run after the smoothing used in the fit; null if no temperature
    was logged."""
    ranges: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = ABSENT
    """Smallest and largest value of each logged channel, by its canonical name, in SI units."""
    same_as: Annotated[int, Field(ge=0)] | None = ABSENT
    """Index in this list, from 0, of the first run with the same samples; null if no earlier run
    has them."""
    channels: dict[str, Channel] = ABSENT
    """Column of the file from which each channel was read; empty for a run that was not read from a
    file. Value in SI units = (cell * scale + offset), converted from the unit."""


class Nominal(ResultObject):
    """Nominal model, without effects."""

    hold: _Hold = ABSENT
    """Voltage between samples in the nominal model; the effect `input_hold` is another one."""
    voltage: _Voltage = ABSENT
    """Voltage that drives the simulation: as logged, or without the noise of its sensor."""
    parameters: MotorParameters


class Shift(ResultObject):
    """Bias of a parameter of the nominal model."""

    before: Parameter
    after: Parameter
    relative: Quantity
    off: bool


class Correlation(ResultObject):
    """Posterior correlation of the parameters."""

    names: list[str]
    """Parameters, those of an effect as effect.parameter."""
    matrix: list[list[Annotated[float, Field(ge=-1, le=1)] | None]]
    """One row for each name; null for a parameter without spread."""


class Alternative(ResultObject):
    """Effect that the runs do not distinguish from a selected one."""

    name: str
    probability: Fraction | None


class RunValues(ResultObject):
    """Size of an effect in one training run."""

    file: Text
    values: dict[str, Parameter]
    """From the covariance of the fit; `identified` is false if the run does not determine it."""


class EffectEntry(ResultObject):
    """Effect that the final model adds to the nominal model."""

    name: str
    variant: str | None = ABSENT
    equation: Literal["electrical", "mechanical", "thermal", "sensor"]
    drivers: Annotated[
        list[Literal["speed", "current", "voltage", "temperature", "position", "time"]],
        Field(json_schema_extra={"uniqueItems": True}),
    ]
    probability: Fraction | None
    comparable: bool = ABSENT
    parameters: dict[str, Parameter]
    runs: list[RunValues] = ABSENT
    """Size in each training run, if it is free in each; else empty."""
    evidence: dict[str, Any]
    alternatives: list[Alternative]


class Coordinate(ResultObject):
    """Parameter of a model, in the coordinate of its covariance."""

    name: str
    unit: str
    estimate: Number
    search: Literal["log", "linear"]
    """Coordinate: the logarithm, or the value over its scale."""
    scale: Number
    """One unit of a linear coordinate, in the unit of the parameter; 1 for a logarithm."""


class ModelTerm(ResultObject):
    """Term of a model: effect type, equation, drivers and settings."""

    name: str
    equation: str
    drivers: list[str]
    settings: Any


class Model(ResultObject):
    """Normal approximation of a model."""

    name: str | None
    """Effect type of the alternative; null for the final model."""
    replaces: str | None
    """Effect of the final model in whose place the alternative stands; null for the final model."""
    odds: NotNegative | None
    """Posterior odds against the final model."""
    hold: _Hold
    """Nominal behaviour of the voltage between samples; the effect input_hold changes it."""
    effective_fraction: Number
    """Independent samples per sample of the residual."""
    terms: list[ModelTerm]
    parameters: list[Coordinate]
    """Parameters in the order of the covariance."""
    covariance: list[list[Number]]
    """Covariance of the coordinates of the parameters, priors included."""
