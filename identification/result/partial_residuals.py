"""Voltage and torque of each effect along the simulation of the final model (partial residuals).

The contribution of an effect to an equation is the state derivative with the effect minus that
without it, times the inductance or inertia without it.  This holds for any effect: a voltage, a
torque, a factor on a coefficient or a temperature.

The corresponding estimate from the data is the missing voltage or torque of the smoother.  The
smoother leaves the nominal-model parameters free, so its trace is ambiguous in the component that
these parameters can produce: a missing voltage proportional to current, speed or di/dt is collinear
with resistance, torque constant or inductance.  This component is taken from the final model, one
coefficient per regressor for all runs together.  The rest of the trace comes from the data alone.
The partial residual of one effect is this trace minus all other fitted effects.

The smoother does not resolve the contribution of an effect that changes L or J, such as an elastic
shaft, because it is proportional to the derivative of the state.  The effect of a sensor is no
voltage or torque of the motor at all.  Such effects are not subtracted, but kept in the model whose
missing terms are smoothed.

Source: Larsen and McCleary, Technometrics 14 (1972), 781-790 (partial residuals).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import casadi as ca
import numpy as np

from identification.arrays import Array, Index, evenly
from identification.diagnosis.deviation import Disturbance
from identification.diagnosis.localise import Localisation, Missing, smoothed_terms
from identification.fit.solve import Fit, TerminationLimits
from identification.linear import least_squares
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record
from identification.model.pointwise import values_at
from identification.quantities import REFERENCE_TEMPERATURE_DEGC
from identification.selection.refit import refitted_without

__all__ = ["PathSamples", "FinalPath", "final_path"]

_DRAWS: Final = 16
_LEAST_DRAWS: Final = 6
_MOST_SIMULATED: Final = 3_000_000
"""Limit on samples times draws, because the states of all draws are held in memory together."""

_SAMPLES: Final = 4000


@dataclass(frozen=True, eq=False)
class PathSamples:
    """Samples of training records along the simulation of the final model."""

    record: Index
    """(n_sample,) index of the record."""
    time: Array
    """(n_sample,) time in its run [s]."""
    drivers: dict[str, Array]
    """Each driver by name, and ``peak_temperature``, (n_sample,) each."""
    rates: Array
    """(n_sample, 2) di/dt and dw/dt [A/s, rad/s^2]."""
    effects: dict[str, Array]
    """Voltage and torque by name of an effect that the localised model lacks,
    (n_draw, n_sample, 2) [V, N m]; the first draw is the fit."""
    missing: Array
    """(n_sample, 2) estimate of these effects together from the data [V, N m]; NaN where
    unknown."""
    missing_sd: Array
    """(n_sample, 2) its standard deviation [V, N m]."""

    def missing_for(self, name: str) -> Array:
        """Partial residual of one effect, (n_sample, 2): trace minus the other fitted effects."""
        others = [effect[0] for other, effect in self.effects.items() if other != name]
        return np.asarray(self.missing - np.sum(others, axis=0)) if others else self.missing


@dataclass(frozen=True, eq=False)
class FinalPath:
    """Simulation of the final model over the training records, for fit and posterior draws."""

    final: Fit
    values: Array
    """(n_parameter, n_draw) physical parameters; the first draw is the fit."""
    states: Sequence[Array]
    """For each record (n_sample, n_state, n_draw)."""
    traces: Sequence[Missing]
    """Missing terms of the nominal model with the effects `kept`, one per record; empty if not
    known."""
    kept: frozenset[str] = frozenset()
    """Names of the effects in the localised model."""

    def keeping(self, names: Collection[str]) -> FinalPath:
        """This path with the missing terms of the final model without all effects but these."""
        kept, model = frozenset(names), self.final.simulator.model
        lacking = [term.name for term in model.terms if term.name not in kept]
        if kept == self.kept or not lacking:
            return self
        fit = self.final
        for name in lacking:
            fit = refitted_without(fit, name, TerminationLimits(0))
        return replace(self, traces=smoothed_terms(fit), kept=kept)

    @cached_property
    def everywhere(self) -> PathSamples:
        """Samples spread over all records, with the collinear component of the final model."""
        return self._own(self._spread)

    @cached_property
    def _spread(self) -> PathSamples:
        """Samples spread over all records, with the missing terms as smoothed."""
        records = self.final.simulator.records
        share = max(2, _SAMPLES // len(records))
        pieces = []
        for number, record in enumerate(records):
            # Inputs of a row describe the interval after it; the last sample starts none.
            pieces.append(self._traced(number, evenly(record.rows - 1, share)))
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(piece, name) for piece in pieces])
            for name in ("record", "time", "rates", "missing", "missing_sd")
        }
        drivers = {n: np.concatenate([p.drivers[n] for p in pieces]) for n in pieces[0].drivers}
        effects = {n: np.concatenate([p.effects[n] for p in pieces], 1) for n in pieces[0].effects}
        return PathSamples(drivers=drivers, effects=effects, **arrays)

    def within(self, number: int, rows: Index) -> PathSamples:
        """Samples (n_sample,) of one record, without its last."""
        return self._own(self._traced(number, rows))

    def _traced(self, number: int, rows: Index) -> PathSamples:
        """Samples of one record with the missing terms as smoothed."""
        values, model = self.values, self.final.simulator.model
        record = self.final.simulator.records[number]
        states, inputs = self.states[number][rows], record.inputs[rows]
        full, _ = _rates(model, states, inputs, values, model)
        effects = {}
        for name in [term.name for term in model.terms if term.name not in self.kept]:
            rates, response = _rates(model.without(name), states, inputs, values, model)
            # The rates of a diverging draw are not finite, nor are its effects.
            with np.errstate(over="ignore", invalid="ignore"):
                effects[name] = (full - rates) / response
        column = {name: inputs[:, INPUTS.index(name)] for name in INPUTS}
        missing, missing_sd = self._smoothed(record, number, rows)
        return PathSamples(
            record=np.full(rows.size, number),
            time=record.time[rows],
            drivers={
                "current": states[:, 0, 0],
                "speed": states[:, 1, 0],
                "voltage": column["voltage"],
                "temperature": column["temperature"],
                "position": column["angle"],
                "time": record.time[rows],
                "peak_temperature": column["peak_temperature"],
            },
            rates=full[0],
            effects=effects,
            missing=missing,
            missing_sd=missing_sd,
        )

    def _smoothed(self, record: Record, number: int, rows: Index) -> tuple[Array, Array]:
        """(n_sample, 2) smoothed missing voltage and torque, and their standard deviations."""
        # The traces are those of the records, in their order.
        found = self.traces[number:][:1]
        if not any((one.run, one.start) == (record.run, record.start) for one in found):
            nothing = np.full((rows.size, 2), np.nan)
            return nothing, nothing
        one, time = found[0], record.time[rows]
        pairs = ((one.voltage, one.torque), (one.voltage_sd, one.torque_sd))
        missing, sd = (
            np.column_stack([np.interp(time, one.time, each) for each in pair]) for pair in pairs
        )
        return missing, sd

    def _own(self, found: PathSamples) -> PathSamples:
        """Replace the collinear component of the smoothed trace by that of the final model."""
        parts = zip(_regressors(found), self._coefficients, strict=True)
        collinear = np.column_stack([columns @ part for columns, part in parts])
        return replace(found, missing=found.missing - collinear)

    @cached_property
    def _coefficients(self) -> list[Array]:
        """Regression coefficients of (smoothed trace - fitted effects) on the regressors."""
        found, parts = self._spread, []
        effects = np.sum([each[0] for each in found.effects.values()], axis=0)
        for k, columns in enumerate(_regressors(found)):
            left = found.missing[:, k] - effects[:, k]
            known = np.isfinite(left)
            size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
            solved = least_squares(columns[known] / size, left[known], 1e-8)
            parts.append(solved / size)
        return parts


def _regressors(found: PathSamples) -> tuple[Array, Array]:
    """Regressors of parameter changes: voltage (n_sample, 5) and torque (n_sample, 4)."""
    current, speed = found.drivers["current"], found.drivers["speed"]
    heat = found.drivers["temperature"] - REFERENCE_TEMPERATURE_DEGC
    both = (current, current * heat, speed, speed * heat)
    voltage = np.column_stack([*both, found.rates[:, 0]])
    return voltage, np.column_stack([current, current * heat, speed, found.rates[:, 1]])


def final_path(
    final: Fit, draws: Mapping[str, Array], localisation: Localisation | None
) -> FinalPath:
    """Simulate the final model for the fit and some posterior draws, (n_draw,) by name.

    `localisation` holds the missing terms of the nominal model; None if not known.  They are
    estimated anew if the final model has effects of sensors as well as of the motor.
    """
    values = _with_draws(final, draws)
    states = final.simulator.states(values, final.states)
    # A draw that diverges, as a wide normal approximation may have, would leave no median.
    finite = np.all([np.isfinite(each).all(axis=(0, 1)) for each in states], axis=0)
    finite[0] = True
    kept = [each[:, :, finite] for each in states]
    traces = localisation.missing if localisation else ()
    path = FinalPath(final, values[:, finite], kept, traces)
    return path.keeping([t.name for t in final.simulator.model.terms if t.equation == "sensor"])


def _with_draws(final: Fit, draws: Mapping[str, Array]) -> Array:
    """Parameters (n_parameter, 1 + n_draw): the fit and some posterior draws."""
    rows = sum(record.rows for record in final.simulator.records)
    wanted = int(np.clip(_MOST_SIMULATED // rows, _LEAST_DRAWS, _DRAWS))
    kept = evenly(draws["J"].size, wanted)
    columns = np.array([draws[name][kept] for name in final.coordinates.names])
    # The linear part of a curve is plotted as part of the parameter it is collinear with.
    columns[["unlisted.linear_" in name for name in final.coordinates.names]] = 0.0
    return np.column_stack([final.values, columns])


def _rates(
    model: MotorModel, states: Array, inputs: Array, values: Array, whole: MotorModel
) -> tuple[Array, Array]:
    """di/dt and dw/dt of a model with a subset of the terms of `whole`, (n_draw, n_sample, 2).

    The second result holds their derivatives by a voltage and by a torque, one over the inductance
    and one over the inertia.  States (n_sample, n_state, n_draw) and values (n_parameter, n_draw)
    are those of `whole`.
    """
    at = [whole.state_names.index(name) for name in model.state_names]
    names = [parameter.name for parameter in whole.parameters]
    own = values[[names.index(parameter.name) for parameter in model.parameters]]
    x, u, p = model.symbols()
    pushed = ca.SX.sym("e", 2)
    rates = model.adding(Disturbance()).rates(x, u, ca.vertcat(p, pushed))[:2]
    response = ca.diag(ca.jacobian(rates, pushed))
    seen = ca.substitute(ca.vertcat(rates, response), pushed, ca.SX.zeros(2))
    function = ca.Function("rates", [x, u, p], [ca.densify(seen)])
    lanes = [np.repeat(one[None], len(inputs), axis=0) for one in own.T]
    found = [values_at(function, states[:, at, k], inputs, one) for k, one in enumerate(lanes)]
    both = np.array(found)
    return both[:, :, :2], both[:, :, 2:]
