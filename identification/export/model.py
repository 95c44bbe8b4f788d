"""Model of an export: the equations of the final model with the inputs of another program.

`predict` takes the shaft angle from the log and knows the run; another program has neither.  The
angle is therefore a state, an input may replace it, and a load torque is a further input.  The run
is a new one after the campaign, so effects of single runs do not act in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.errors import InputError
from identification.model.composite import INPUTS, MotorModel
from identification.model.parameter import Parameter
from identification.model.step import step_function
from identification.model.step_plan import StepPlan, plan_for, spectral_radius
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractMean,
    AbstractSampleFilter,
    AbstractTerm,
    AbstractTorque,
    AbstractVoltageFilter,
    Expression,
    Signals,
    Values,
)
from identification.prediction import hottest_of, model_of
from identification.quantities import REFERENCE_TEMPERATURE_DEGC
from identification.result.numbers import finite

__all__ = ["EXTERNAL", "ExportModel", "Exported", "entries_of", "exported_model"]

EXTERNAL: Final = ("load_torque", "angle_given")
"""Last two parameters of an exported model, which are inputs of the program that uses it."""

_MARGIN: Final = 1.5
_USUAL_INTERVAL: Final = 1e-3
_ANGLE: Final = INPUTS.index("angle")
_SHARES: Final = (-1.0, -0.3, -1e-3, 0.0, 1e-3, 0.3, 1.0)
"""Currents and speeds over their ranges at which the stiffness is evaluated [-]."""


@dataclass(frozen=True)
class _External(AbstractTorque):
    """External load torque, against positive speed."""

    name = "external"
    equation = "mechanical"
    drivers = ()
    parameters = (
        Parameter(EXTERNAL[0], "N m", "external load torque, positive against positive speed"),
        Parameter(EXTERNAL[1], "1", "1 if the input angle is used, 0 for the simulated angle"),
    )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.load_torque


@dataclass(frozen=True)
class ExportModel(MotorModel):
    """Motor model in a new run, whose last state is the shaft angle [rad]."""

    run: int = 0
    """Number of runs in the campaign, which is the index of the new run."""

    @cached_property
    def motor(self) -> MotorModel:
        """Motor without the state of the shaft angle."""
        return MotorModel(self.terms, self.hold)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """States of the motor, and the shaft angle."""
        return (*self.motor.state_names, "angle")

    def rates(
        self,
        state: Expression,
        inputs: Expression,
        parameter: Expression,
        *,
        is_averaged: bool = False,  # noqa: ARG002  the angle is a state, so no input has its change
    ) -> Expression:
        """Right-hand side (n_state,) of the motor and of the shaft angle."""
        own, driven = self._driven(state, inputs, parameter)
        return ca.vertcat(self.motor.rates(own, driven, parameter), own[1])

    def logged(self, state: Expression, inputs: Expression, parameter: Expression) -> Expression:
        own, driven = self._driven(state, inputs, parameter)
        return self.motor.logged(own, driven, parameter)

    def _driven(
        self, state: Expression, inputs: Expression, parameter: Expression
    ) -> tuple[Expression, Expression]:
        count = len(self.motor.state_names)
        rows = [inputs[k] for k in range(len(INPUTS))]
        given = parameter[len(self.parameters) - 1]
        rows[_ANGLE] = given * rows[_ANGLE] + (1 - given) * state[count]
        rows[INPUTS.index("run")] = ca.SX(self.run)
        return state[:count], ca.vertcat(*rows)


@dataclass(frozen=True)
class Exported:
    """A model ready for export."""

    model: ExportModel
    """The model; its last two parameters are `EXTERNAL`."""
    values: Array
    """(n_parameter,) physical values."""
    interval: float
    """Sample interval of the runs, the design step of the export [s]."""
    span: Array
    """(2,) range of current and speed in the training runs [A, rad/s]."""
    peak: float
    """Highest temperature that the motor has had [degC]."""
    plan: StepPlan
    """Settings of the integration step at `interval`."""
    notes: tuple[str, ...] = ()
    """What the export does not hold, as sentences."""

    @property
    def step(self) -> ca.Function:
        """SX function (carry, inputs, parameter) -> (carry at the next sample, readings)."""
        return step_function(self.model, self.plan)

    @property
    def parameters(self) -> tuple[tuple[Parameter, float], ...]:
        """Parameters of motor and effects with their values, without `EXTERNAL`."""
        own = self.model.parameters[: -len(EXTERNAL)]
        return tuple(zip(own, self.values.tolist(), strict=False))

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each state."""
        own = [state.unit for term in self.model.terms for state in term.states]
        return ("A", "rad/s", *own, "rad")

    @property
    def starts(self) -> tuple[str, ...]:
        """For each state what it equals at the start: a signal, or ``zero``."""
        own = [state.follows for term in self.model.terms for state in term.states]
        return ("current", "speed", *own, "zero")


def exported_model(result: Mapping[str, Any]) -> Exported:
    """The final model of a result, prepared for export.

    Raises:
        InputError: A parameter or effect is missing or unknown.
    """
    model, values = model_of(result)
    runs = entries_of(result.get("runs"))
    named = dict(zip([p.name for p in model.parameters], values, strict=True))
    notes, kept = [], []
    for term in model.terms:
        note, is_kept = _note(term, len(runs))
        notes += [f"{term.name}{note}"] if note else []
        kept += [term] if is_kept else []
    new = ExportModel((*kept, _External()), model.hold, run=len(runs))
    named |= {f"{_External.name}.{name}": 0.0 for name in EXTERNAL}
    own = np.array([named[p.name] for p in new.parameters])
    rates = [finite(run.get("sample_rate_hz")) for run in runs if run.get("role") == "training"]
    rate = float(np.median([r for r in rates if r] or [1.0 / _USUAL_INTERVAL]))
    interval = next((t.interval for t in new.delays), float(f"{1.0 / rate:.9g}"))
    span = _span(result)
    stiffness = _stiffness(new, own, span) * interval
    if not stiffness > 0.0:
        raise InputError(
            "the model of the result cannot be evaluated; expected a result.json as written by "
            "'motorid fit'"
        )
    return Exported(
        new, own, interval, span, hottest_of(runs, REFERENCE_TEMPERATURE_DEGC),
        plan_for(_MARGIN * stiffness), tuple(notes),
    )  # fmt: skip


def entries_of(found: object) -> list[Mapping[str, Any]]:
    """Objects in a list of a result; none if a member is something else."""
    return [one for one in found if isinstance(one, Mapping)] if isinstance(found, list) else []


def _stiffness(model: ExportModel, values: Array, span: Array) -> float:
    """Largest spectral radius of df/dx over the signals of the training runs [1/s].

    The values are physical, (n_parameter,); `span` (2,) is the range of current and speed [A,
    rad/s].
    """
    levels = np.array(list(product(_SHARES, repeat=2))) * span
    states = np.pad(levels, ((0, 0), (0, len(model.state_names) - 2)))
    inputs = np.zeros((len(levels), len(INPUTS)))
    for name in ("temperature", "peak_temperature"):
        inputs[:, INPUTS.index(name)] = REFERENCE_TEMPERATURE_DEGC
    return spectral_radius(model, states, inputs, np.tile(values, (len(levels), 1)))


def _note(term: AbstractTerm, run: int) -> tuple[str, bool]:
    """The part of a term that the export omits, or an empty text, and True if the term remains."""
    is_delay = isinstance(term, AbstractDelay) and term.channel == "voltage"
    is_late = isinstance(term, AbstractHold) and term.is_late
    if is_delay or is_late or isinstance(term, AbstractVoltageFilter):
        return (
            ": the logged voltage lagged the terminals; the input of the export is the voltage at "
            "the terminals"
        ), False
    if isinstance(term, AbstractDelay | AbstractHold | AbstractMean | AbstractSampleFilter):
        return "", True
    if not _acts(term, run):
        variant = getattr(term, "variant", "") or "of the campaign"
        return f" acts only in runs of the campaign ({variant}); it is left out", False
    own = ", ".join(state.name for state in term.states if state.is_own)
    note = (
        f" has values of each run ({own}); they are zero at the start of the export, and predict "
        "fits them to the first samples"
    )
    return note if own else "", True


def _acts(term: AbstractTerm, run: int) -> bool:
    """Return True if a term changes the motor or a reading in a new run."""
    alone = ExportModel((term, _External()), run=run)
    x, u, p = alone.symbols()
    first = len(MotorModel().parameters)
    own = [p[first + k] for k in range(len(term.parameters))]
    own += [x[2 + k] for k in range(len(term.states))]
    seen = ca.vertcat(alone.rates(x, u, p)[:2], alone.logged(x, u, p))
    return not own or bool(ca.depends_on(seen, ca.vertcat(*own)))


def _span(result: Mapping[str, Any]) -> Array:
    """Four standard deviations of current and speed in the training runs (2,) [A, rad/s].

    A result contains the standard deviation as the ratio of RMSE and relative RMSE.
    """
    errors: Any = result
    for name in ("errors", "after", "training"):
        errors = errors.get(name) if isinstance(errors, Mapping) else None
    found = []
    for channel in ("current", "speed"):
        entry = errors.get(channel) if isinstance(errors, Mapping) else None
        entry = entry if isinstance(entry, Mapping) else {}
        rmse, relative = finite(entry.get("rmse")), finite(entry.get("nrmse"))
        found.append(4.0 * rmse / relative if rmse and relative else 1.0)
    return np.array(found)
