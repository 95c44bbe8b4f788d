"""Members of result.json, schema version 1, from which its JSON Schema (2020-12) is generated."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field
from pydantic.json_schema import GenerateJsonSchema

from identification.effects.catalogue import CATALOGUE
from identification.quantities import DECLARED_PARAMETERS
from identification.result.members import (
    ABSENT,
    Correlation,
    EffectEntry,
    Fraction,
    Model,
    MotorParameters,
    Nominal,
    NotNegative,
    Number,
    Positive,
    Quantity,
    ResultObject,
    Role,
    RunEntry,
    Shift,
    Text,
)

__all__ = ["Result", "result_schema"]


# As a second type of the object, not in a union: a validator then names the missing member.
_OR_NULL = ConfigDict(json_schema_extra={"type": ["object", "null"]})


class ChannelCheck(ResultObject):
    """Residual tests of one channel."""

    channel: Literal["current", "speed"]
    role: Role
    noise_ratio: NotNegative | None
    noise_ratio_limit: NotNegative | None = ABSENT
    whiteness_p: Fraction | None = ABSENT
    voltage_outside: Fraction | None = ABSENT
    passed: bool
    reason: str


class Detection(ResultObject):
    """Residual tests of the model; empty if they were not made."""

    missing: bool = ABSENT
    sentence: str = ABSENT
    level: Fraction | None = ABSENT
    checks: list[ChannelCheck] = ABSENT


class Driver(ResultObject):
    """Dependence of a missing term on one signal."""

    correlation: Annotated[float, Field(ge=-1.0000001, le=1.0000001)] | None = ABSENT
    share: Fraction | None = ABSENT


class Deficiency(ResultObject):
    """Missing voltage or torque of one equation."""

    strength: NotNegative | None
    unit: str
    time_constant_s: NotNegative | None = ABSENT
    log_likelihood_gain: Number = ABSENT
    p_value: Fraction | None
    significant: bool
    drivers: dict[str, Driver] = ABSENT


class Curve(ResultObject):
    """Curve of a missing term in one driver."""

    equation: Literal["electrical", "mechanical"]
    driver: str
    log_likelihood_gain: Number
    share: Number


class Trace(ResultObject):
    """Missing voltage or torque of each equation; empty if it was not estimated."""

    electrical: Deficiency = ABSENT
    mechanical: Deficiency = ABSENT
    curves: list[Curve] = ABSENT


class Remaining(Detection):
    """Residual tests and missing terms of the final model."""

    electrical: Deficiency = ABSENT
    mechanical: Deficiency = ABSENT


class Omitted(ResultObject):
    """Omitted term."""

    name: str
    promised_log_likelihood_gain: Number
    log_likelihood_gain_by_chance: Number
    share: Fraction = ABSENT
    changes: dict[str, float]


class Confounded(ResultObject):
    """Effect confounded with a parameter."""

    name: str
    parameter: str
    log_likelihood_gain: float
    log_likelihood_loss_limit: float
    time_constant_s: Number
    changes: dict[str, float]


class Diagnosis(ResultObject):
    """Deficiency of the nominal model, search for effects, and what remains."""

    residual: Detection
    trace: Trace
    """Missing voltage or torque of each equation of the nominal model; empty if it was not
    estimated."""
    searched: list[Any]
    omitted: list[Omitted] = ABSENT
    """Omitted terms: their predicted gain exceeds chance, but they do not meet the acceptance
    criteria; the intervals include the parameter changes that they could cause."""
    confounded: list[Confounded] = ABSENT
    """Effects that are confounded with a parameter and that the runs do not exclude; the intervals
    include the parameter changes that they could cause."""
    remaining: Remaining
    shifts: dict[str, Shift] = ABSENT
    """Bias of each parameter of the nominal model by the missing effects; empty if no effect was
    found."""


class Error(ResultObject):
    """Simulation error of one channel."""

    rmse: NotNegative | None
    nrmse: NotNegative | None
    noise_ratio: NotNegative | None


class Channels(ResultObject):
    """Errors by channel; null if there is no run of this role."""

    model_config = _OR_NULL

    current: Error
    speed: Error


class Roles(ResultObject):
    """Errors by role of the runs."""

    training: Channels
    validation: Channels


class Errors(ResultObject):
    """Simulation errors of the nominal and of the final model."""

    before: Roles
    after: Roles


class Noise(ResultObject):
    """Standard deviation of the sensor noise."""

    current_A: NotNegative | None
    speed_rad_s: NotNegative | None


class Loop(ResultObject):
    """Metrics of the closed speed loop."""

    temperature_degC: float
    controller: Text
    rise_time_s: Quantity
    settling_time_s: Quantity
    peak: Quantity
    peak_time_s: Quantity
    overshoot_percent: Quantity
    steady_state: Quantity
    gain_margin_db: Quantity
    phase_margin_deg: Quantity
    bandwidth_rad_s: Quantity
    stable_probability: Fraction | None = ABSENT
    statement: str = ABSENT


class NonlinearLoop(Loop):
    """Metrics of the loop simulated with effects."""

    step_rad_s: Positive
    effects: list[str]


class Sampler(ResultObject):
    """Diagnostics of the sampler; null if no posterior was sampled."""

    model_config = _OR_NULL

    walkers: Annotated[int, Field(ge=1)] | None
    steps: Annotated[int, Field(ge=1)] | None
    acceptance: Fraction | None
    autocorrelation_time: NotNegative | None
    ess_min: NotNegative | None
    r_hat_max: NotNegative | None
    converged: bool = ABSENT
    draws: Literal["chain", "importance", "normal"] = ABSENT
    """Source of the draws: the chain or, if it did not converge, importance sampling or the normal
    approximation."""
    pareto_k: Number = ABSENT
    """Pareto shape of the importance weights; null if importance sampling was not used."""


class ResultLabel(ResultObject):
    """Names that the user gave."""

    model_config = ConfigDict(extra="forbid")

    motor: str = ABSENT
    """Name of the motor."""
    bench: str = ABSENT
    """Name of the test bench."""


class Check(ResultObject):
    """Finding of a check of the runs or of the fitted motor."""

    code: str
    severity: Literal["refuse", "suspect"]
    file: str | None = ABSENT
    column: str | None = ABSENT
    message: str
    statistic: str = ABSENT
    value: float = ABSENT
    limit: float = ABSENT
    corrections: list[str] = ABSENT


class SetAside(ResultObject):
    """Run that was set aside."""

    file: str
    role: Role


class WarningDetail(ResultObject):
    """Code, severity and remedy of a warning."""

    code: Text
    severity: Literal["critical", "warning", "note"]
    fix: str
    fix_http: str = ABSENT
    """Field of the form and option of a request for the same remedy."""


class Result(ResultObject):
    """File result.json of motorid fit. Unknown numbers are null; members may be added."""

    schema_version: Literal[1]
    label: ResultLabel = ABSENT
    """Names that the user gave; absent if none."""
    software: Annotated[dict[str, str], Field(json_schema_extra={"required": ["motorid"]})]
    """Versions of the software that computed the result."""
    runs: Annotated[list[RunEntry], Field(min_length=1)]
    declared: Nominal
    parameters: MotorParameters
    """Final model, with the selected effects."""
    correlation: Correlation = ABSENT
    """Posterior correlation of the parameters of the final model."""
    effects: list[EffectEntry]
    """Effects that the final model adds to the nominal model, strongest evidence first; empty if
    there are none."""
    models: Annotated[list[Model], Field(min_length=1)] = ABSENT
    """Normal approximation of the final model, then of each alternative of its effects; the design
    of the next run starts from them."""
    diagnosis: Diagnosis
    errors: Errors
    noise: Noise
    feedback: list[Loop]
    """Metrics of the closed speed loop, one item per controller and temperature."""
    feedback_before: list[Loop] = ABSENT
    """The same for the nominal model; empty if no effect was found."""
    feedback_suited: list[Loop] = ABSENT
    """Metrics with the PI controller of the magnitude optimum; empty if the rule gives none."""
    feedback_nonlinear: list[NonlinearLoop] = ABSENT
    """Metrics of the loop simulated with the effects; empty if no effect acts in the loop."""
    sampler: Sampler
    checks: list[Check] = ABSENT
    """Findings of the checks of the runs before the fit, and implausible time constants of the
    fitted motor."""
    forced: bool = ABSENT
    """True if contradictory runs were fitted with --force."""
    set_aside: list[SetAside] = ABSENT
    """Runs that were set aside because of a contradiction."""
    warnings: list[Text]
    warning_details: list[WarningDetail] = ABSENT
    """Code, severity and remedy of each warning, in the order of warnings."""


def _in_short(node: dict[str, Any]) -> dict[str, Any]:
    """Schema without a generated title, and with null as a second type instead of a union."""
    if isinstance(node.get("title"), str):
        del node["title"]
    match node.get("anyOf"):
        case [{"type": str(kind)} as plain, {"type": "null"}]:
            del node["anyOf"]
            return {**node, **plain, "type": [kind, "null"]}
    return node


def result_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of result.json, with the names of all effects of the catalogue."""
    generated = json.dumps(Result.model_json_schema())
    schema: dict[str, Any] = json.loads(generated, object_hook=_in_short)
    parameter = {"$ref": "#/$defs/Parameter"}
    schema["$defs"]["EffectEntry"]["properties"]["name"]["enum"] = [*CATALOGUE, "unlisted"]
    schema["$defs"]["MotorParameters"] |= {
        "additionalProperties": parameter,
        "required": [*DECLARED_PARAMETERS],
        "properties": {
            name: parameter | {"properties": {"unit": {"const": declared.unit}}}
            for name, declared in DECLARED_PARAMETERS.items()
        },
    }
    return schema | {
        "$schema": GenerateJsonSchema.schema_dialect,
        "$id": "urn:motorid:result:1",
        "title": "Result of an identification, schema version 1",
    }
