"""The effects of the final model as torques and voltages along its own simulation.

What an effect adds to a balance is the rate with it less the rate without it, times L or J: this
holds for any effect, whether it is a voltage, a torque, a factor on a coefficient or a temperature.

What the data say of it is the missing voltage or torque that the smoother found.  The smoother lets
the declared parameters float, and a trace is therefore open to what those can imitate: a missing
voltage in proportion to current, speed or di/dt may as well be resistance, torque constant or
inductance.  That part is taken as the final model has it, which is one number a parameter for all
runs together; the form of what is left, and all other effects taken out, is the data's own.

Source: Larsen and McCleary, Technometrics 14 (1972), 781-790 (partial residuals).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.localise import Localisation, Missing
from identification.fit.solve import Fit
from identification.linear import least_squares
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["Along", "FinalPath", "final_path"]

Array = NDArray[np.float64]

_DRAWS: Final = 16
_LEAST_DRAWS: Final = 6
_MOST_SIMULATED: Final = 3_000_000
"""Samples simulated with all draws: their states are held in memory together."""

_SAMPLES: Final = 4000
_STEPS_KEPT: Final = ("L", "J")


@dataclass(frozen=True, eq=False)
class Along:
    """Samples of training records along the simulation of the final model.

    Args:
        record: (n_sample,) number of the record.
        time: (n_sample,) time in its run [s].
        drivers: (n_sample,) of each driver by name, and of ``peak_temperature``.
        rates: (n_sample, 2) di/dt and dw/dt [A/s, rad/s^2].
        effects: By name, (n_draw, n_sample, 2) voltage and torque; the first draw is the fit.
        missing: (n_sample, 2) what the data say of all effects together; NaN where unknown.
        missing_sd: (n_sample, 2) its standard deviation.
    """

    record: NDArray[np.int_]
    time: Array
    drivers: dict[str, Array]
    rates: Array
    effects: dict[str, Array]
    missing: Array
    missing_sd: Array

    def missing_for(self, name: str) -> Array:
        """What the data say of one effect, (n_sample, 2): the others are taken out as fitted."""
        others = [effect[0] for other, effect in self.effects.items() if other != name]
        return np.asarray(self.missing - np.sum(others, axis=0)) if others else self.missing


@dataclass(frozen=True, eq=False)
class FinalPath:
    """The final model simulated over the training records, for the fit and for some draws.

    Args:
        final: Fit of the final model.
        values: (n_parameter, n_draw) physical; the first draw is the fit.
        states: For each record (n_sample, n_state, n_draw).
        localisation: The missing terms beside the declared model; None where not known.
    """

    final: Fit
    values: Array
    states: Sequence[Array]
    localisation: Localisation | None

    @cached_property
    def everywhere(self) -> Along:
        """Samples spread over all records."""
        return self._own(self._spread)

    @cached_property
    def _spread(self) -> Along:
        """The same as the smoother has it."""
        records = self.final.simulator.records
        share = max(2, _SAMPLES // len(records))
        pieces = []
        for number, record in enumerate(records):
            # The last sample begins no interval, and its inputs do not go on.
            rows = np.linspace(0, record.rows - 2, min(share, record.rows - 1))
            pieces.append(self._traced(number, np.unique(rows.astype(int))))
        names = [term.name for term in self.final.simulator.model.terms]
        return Along(
            record=np.concatenate([p.record for p in pieces]),
            time=np.concatenate([p.time for p in pieces]),
            drivers={
                name: np.concatenate([p.drivers[name] for p in pieces])
                for name in pieces[0].drivers
            },
            rates=np.concatenate([p.rates for p in pieces]),
            effects={name: np.concatenate([p.effects[name] for p in pieces], 1) for name in names},
            missing=np.concatenate([p.missing for p in pieces]),
            missing_sd=np.concatenate([p.missing_sd for p in pieces]),
        )

    def within(self, number: int, rows: NDArray[np.int_]) -> Along:
        """Some samples of one record.

        Args:
            number: The record.
            rows: (n_sample,) positions in it, the last sample not among them.
        """
        return self._own(self._traced(number, rows))

    def _traced(self, number: int, rows: NDArray[np.int_]) -> Along:
        record = self.final.simulator.records[number]
        missing = _missing_of(self.localisation, record, number)
        return _piece(self.final, self.values, (number, self.states[number]), missing, rows)

    def _own(self, found: Along) -> Along:
        """The trace with the declared parameters that the final model has."""
        imitated = np.column_stack(
            [columns @ part for columns, part in zip(_imitations(found), self._imitated,
                                                     strict=True)]
        )  # fmt: skip
        return replace(found, missing=found.missing - imitated)

    @cached_property
    def _imitated(self) -> list[Array]:
        """How much of each column of `_imitations` is in the trace and not in the effects."""
        found, parts = self._spread, []
        effects = np.sum([each[0] for each in found.effects.values()], axis=0)
        for k, columns in enumerate(_imitations(found)):
            left = found.missing[:, k] - effects[:, k]
            known = np.isfinite(left)
            size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
            solved = least_squares(columns[known] / size, left[known], 1e-8)
            parts.append(solved / size)
        return parts


def _imitations(found: Along) -> tuple[Array, Array]:
    """What changes of declared parameters add to voltage (n_sample, 5) and torque (n_sample, 4)."""
    current, speed = found.drivers["current"], found.drivers["speed"]
    heat = found.drivers["temperature"] - REFERENCE_TEMPERATURE_DEGC
    both = (current, current * heat, speed, speed * heat)
    voltage = np.column_stack([*both, found.rates[:, 0]])
    return voltage, np.column_stack([current, current * heat, speed, found.rates[:, 1]])


def final_path(
    final: Fit, draws: Mapping[str, Array], localisation: Localisation | None
) -> FinalPath:
    """Simulate the final model once more, with some draws of its posterior.

    Args:
        final: Fit of the final model.
        draws: Draws of its posterior by name, (n_draw,) each.
        localisation: The missing terms beside the declared model; None where not known.
    """
    values = _with_draws(final, draws)
    return FinalPath(final, values, final.simulator.states(values, final.states), localisation)


def _with_draws(final: Fit, draws: Mapping[str, Array]) -> Array:
    """(n_parameter, 1 + n_draw): the fit and some draws of the posterior."""
    rows = sum(record.rows for record in final.simulator.records)
    wanted = int(np.clip(_MOST_SIMULATED // rows, _LEAST_DRAWS, _DRAWS))
    kept = np.unique(np.linspace(0, draws["J"].size - 1, wanted).astype(int))
    columns = np.array([np.asarray(draws[name])[kept] for name in final.coordinates.names])
    # A line that is the curve's or a declared parameter's is drawn with the parameter.
    columns[["unlisted.linear_" in name for name in final.coordinates.names]] = 0.0
    return np.column_stack([final.values, columns])


def _missing_of(localisation: Localisation | None, record: Record, k: int) -> Missing | None:
    """The missing terms of one record: pieces come one a record, in their order."""
    if localisation is None or k >= len(localisation.missing):
        return None
    found = localisation.missing[k]
    return found if found.run == record.run and found.start == record.start else None


def _piece(
    final: Fit,
    values: Array,
    simulated: tuple[int, Array],
    missing: Missing | None,
    rows: NDArray[np.int_],
) -> Along:
    number, path = simulated
    model, record = final.simulator.model, final.simulator.records[number]
    states, inputs = path[rows], record.inputs[rows]
    full = _rates(model, states, inputs, values, model)
    inertias = _sizes(model, values)
    found, spread = _interpolated(missing, record.time[rows])
    # A draw that runs away has no rates, and no share of an effect in them.
    with np.errstate(over="ignore", invalid="ignore"):
        effects = {
            term.name: (full - _rates(model.without(term.name), states, inputs, values, model))
            * inertias[:, None, :]
            for term in model.terms
        }
    column = {name: inputs[:, INPUTS.index(name)] for name in INPUTS}
    return Along(
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
        missing=found,
        missing_sd=spread,
    )


def _sizes(model: MotorModel, values: Array) -> Array:
    """(n_lane, 2) inductance and inertia [H, kg m^2]."""
    names = [parameter.name for parameter in model.parameters]
    return np.column_stack([values[names.index(name)] for name in _STEPS_KEPT])


def _interpolated(missing: Missing | None, time: Array) -> tuple[Array, Array]:
    """(n_sample, 2) missing voltage and torque at given times, and their standard deviations."""
    if missing is None:
        nothing = np.full((time.size, 2), np.nan)
        return nothing, nothing
    series = ((missing.voltage, missing.torque), (missing.voltage_sd, missing.torque_sd))
    found, spread = (
        np.column_stack([np.interp(time, missing.time, each) for each in pair]) for pair in series
    )
    return found, spread


def _rates(
    model: MotorModel, states: Array, inputs: Array, values: Array, whole: MotorModel
) -> Array:
    """(n_lane, n_sample, 2) di/dt and dw/dt of a model that holds part of the terms of `whole`.

    Args:
        model: The model.
        states: (n_sample, n_state, n_lane) of `whole`.
        inputs: (n_sample, n_input).
        values: (n_parameter, n_lane) of `whole`.
        whole: Whose states and parameters these are.
    """
    at = [whole.state_names.index(name) for name in model.state_names]
    names = [parameter.name for parameter in whole.parameters]
    own = values[[names.index(parameter.name) for parameter in model.parameters]]
    x = ca.SX.sym("x", len(at))
    u = ca.SX.sym("u", len(INPUTS))
    p = ca.SX.sym("p", own.shape[0])
    function = ca.Function("rates", [x, u, p], [model.rates(x, u, p)[:2]])
    samples = inputs.shape[0]
    found = [
        np.asarray(
            function(states[:, at, lane].T, inputs.T, np.repeat(own[:, lane, None], samples, 1))
        ).T
        for lane in range(own.shape[1])
    ]
    return np.array(found)
