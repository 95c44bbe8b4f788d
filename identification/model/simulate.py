"""Simulation of a model over records for many parameter vectors at once.

    simulator = Simulator.fitting(model, records, values)
    simulator.logged(lanes, states)         simulated sensor readings

Parameters are physical values: `values` is (n_parameter,), `lanes` is (n_parameter, n_lane).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.model.composite import INPUTS, MotorModel
from identification.model.division import (
    Counts,
    begins,
    divided,
    evenly,
    halves,
    more_parts,
)
from identification.model.excitation import Record
from identification.model.memory import memory_start
from identification.model.misfit import MisfitLoop, is_slow, misfit_loop
from identification.model.rate import rate_of
from identification.model.scan import Effort, Scan, scan_of
from identification.model.step import (
    Plan,
    advance,
    plan_for,
    step_function,
)
from identification.model.weighting import Weighting

__all__ = ["Simulator", "initial_states"]

Array = NDArray[np.float64]

_SAMPLED: Final = 100
_LOOKS: Final = 6
_STRUCTURES: Final = 128


def initial_states(model: MotorModel, record: Record) -> Array:
    """Default initial state of a record, (n_state,).

    Current and speed are the logged ones; the states of terms have their steady-state values.
    """
    current, speed = record.head
    known = {
        "temperature": record.column("temperature")[0],
        "current": current,
        "speed": speed,
        "zero": 0.0,
    }
    own = [known[state.follows] for term in model.terms for state in term.states]
    return np.array([current, speed, *own])


def _symbols(model: MotorModel) -> tuple[ca.SX, ca.SX, ca.SX]:
    return (
        ca.SX.sym("x", len(model.state_names)),
        ca.SX.sym("u", len(INPUTS)),
        ca.SX.sym("p", len(model.parameters)),
    )


@dataclass(frozen=True)
class Simulator:
    """Model prepared for simulation over records.

    Args:
        model: The model.
        records: Records that drive the model.
        plan: Settings of the integration step; see `plan_for`.
        divisions: For each record (n_sample,) substeps of each sample interval; None for one each.
    """

    model: MotorModel
    records: tuple[Record, ...]
    plan: Plan
    divisions: tuple[Counts, ...] | None = None

    @cached_property
    def inputs(self) -> list[Array]:
        """Inputs of each record (n_row, n_input), one row per substep."""
        shifted = [self._shifted(record.inputs) for record in self.records]
        if self.divisions is None:
            return shifted
        pairs = zip(shifted, self.divisions, strict=True)
        return [divided(inputs, counts, self.model.held) for inputs, counts in pairs]

    @cached_property
    def begins(self) -> list[NDArray[np.intp]] | None:
        """Row index of each sample, for each record; None if every row is a sample."""
        return None if self.divisions is None else [begins(c) for c in self.divisions]

    def _sampled(self, rows: list[Array]) -> list[Array]:
        """Select the rows at samples from arrays with one row per substep."""
        if self.begins is None:
            return rows
        return [y[at] for y, at in zip(rows, self.begins, strict=True)]

    def _shifted(self, inputs: Array) -> Array:
        """Inputs with the voltage advanced by `model.advance` samples."""
        ahead = self.model.advance
        if not ahead:
            return inputs
        shifted = inputs.copy()
        rows = np.minimum(np.arange(inputs.shape[0]) + ahead, inputs.shape[0] - 1)
        for name in ("voltage", "voltage_next"):
            column = INPUTS.index(name)
            shifted[:, column] = inputs[rows, column]
        return shifted

    def carries(self, states: Sequence[Array], lanes: int) -> list[Array]:
        """Carry before the first sample of each record, (n_state + n_memory, n_lane)."""
        return [
            np.concatenate(
                [
                    _lanes(state, lanes),
                    _lanes(memory_start(self.model, record.head), lanes),
                ]
            )
            for state, record in zip(states, self.records, strict=True)
        ]

    @staticmethod
    def fitting(
        model: MotorModel,
        records: Sequence[Record],
        values: Array,
        divisions: tuple[Counts, ...] | None = None,
        margin: float = 1.5,
    ) -> Simulator:
        """Simulator with an integration plan for `values`.

        The plan covers `margin` times the largest spectral radius of h df/dx at `values`.  The edge
        samples that the model cannot predict lose their weight.
        """
        rate = Simulator.rate(model, records, values)
        plan = plan_for(margin * rate, linear=not model.terms)
        known = tuple(record.within(model.edges) for record in records)
        return Simulator(model, known, plan, divisions)

    def divided_for(
        self,
        values: Array,
        states: Sequence[Array],
        tolerance: Array,
        looks: int = _LOOKS,
        start: tuple[Counts, ...] | None = None,
    ) -> Simulator:
        """Refine the substeps until each sample interval meets the tolerance at `values`.

        The error of a substep is the change of current and speed when it is halved.

        Args:
            values: (n_parameter,) physical.
            states: For each record (n_state,) at its first sample.
            tolerance: (2,) allowed error of current and speed per sample interval [A, rad/s].
            looks: Largest number of error measurements.
            start: Substep counts to start from; one each if absent.
        """
        divisions = start or evenly([record.rows for record in self.records], 1)
        for _ in range(looks):
            simulator = replace(self, divisions=divisions)
            errors = simulator._errors_of_parts(values, states)
            more = tuple(
                more_parts(counts, error, tolerance)
                for counts, error in zip(divisions, errors, strict=True)
            )
            if all(np.array_equal(a, b) for a, b in zip(more, divisions, strict=True)):
                break
            divisions = more
        if all((counts == 1).all() for counts in divisions):
            return replace(self, divisions=None)
        return replace(self, divisions=divisions)

    def _errors_of_parts(self, values: Array, states: Sequence[Array]) -> list[Array]:
        """For each record (n_row, 2) change of current and speed when each substep is halved."""
        carries = [_lanes(state, 1) for state in states]
        errors = _errors_scan(self.model, self.plan)(self.inputs, values[:, None], carries)[1]
        return [error[:, :, 0] for error in errors]

    @staticmethod
    def rate(model: MotorModel, records: Sequence[Record], values: Array) -> float:
        """Largest spectral radius of h df/dx along the measured current and speed [-]."""
        states = []
        for record in records:
            rows = np.linspace(0, record.rows - 1, min(_SAMPLED, record.rows)).astype(int)
            start = initial_states(model, record)
            points = np.repeat(start[None, :], rows.size, axis=0)
            points[:, :2] = record.measured[rows]
            states.append(points)
        return rate_of(model, records, values, states)

    @property
    def n_state(self) -> int:
        """Number of states."""
        return len(self.model.state_names)

    def logged(
        self, values: Array, states: Sequence[Array], effort: Effort = "some"
    ) -> list[Array]:
        """Simulated sensor readings.

        Args:
            values: (n_parameter, n_lane) physical.
            states: For each record (n_state,) or (n_state, n_lane) at its first sample.
            effort: Optimisation level of the compiled loop; see `Scan`.

        Returns:
            For each record (n_sample, 2, n_lane) [A, rad/s].
        """
        scan = _logged_scan(self.model, self.plan, effort)
        carries = self.carries(states, values.shape[1])
        return self._sampled(scan(self.inputs, values, carries)[1])

    def misfit(self, values: Array, states: Sequence[Array], weighting: Weighting) -> Array:
        """Weighted sums of squares of the whitened residuals, (2, n_lane) [A^2, rad^2/s^2].

        A likelihood evaluation consists of one such call.  The sums are part of the carry, so no
        time series is written to memory.

        Args:
            values: (n_parameter, n_lane) physical.
            states: For each record (n_state,) or (n_state, n_lane).
            weighting: Noise model; the sums are not divided by its variances.
        """
        loop, rows = self._compared(weighting)
        starts = self.carries(states, values.shape[1])
        own = starts[0].shape[0]
        sums = np.zeros((loop.scan.n_carry - own, values.shape[1]))
        finals, _ = loop.scan(rows, values, [np.concatenate([x, sums]) for x in starts])
        return np.asarray(np.sum([f[own : own + 2] for f in finals], axis=0))

    def misfit_work(self, lanes: int, weighting: Weighting) -> float:
        """Number of operations of one call of `misfit` with the given number of lanes."""
        loop, rows = self._compared(weighting)
        return sum(loop.scan.work(each.shape[0], lanes) for each in rows)

    def _compared(self, weighting: Weighting) -> tuple[MisfitLoop, list[Array]]:
        """Misfit loop for a noise model, and its input rows for each record.

        Both are kept between calls, because copying the rows costs as much as simulating a block of
        lanes.  They remain valid while only the noise standard deviations change.
        """
        key = (weighting.records, weighting.robust, weighting.whitening)
        kept = self._kept.get("compared")
        if kept is None or any(a is not b for a, b in zip(kept[0], key, strict=True)):
            weights = [weighting.sample_weights(k) for k in range(len(self.records))]
            loop = misfit_loop(
                self.model,
                self.plan,
                tuple(tuple(float(tap) for tap in taps) for taps in weighting.whitening),
                weighted=any(np.any(weight != 1.0) for weight in weights),
                interpolated=self._interpolates,
                divided=self.divisions is not None,
            )
            rows = [
                loop.rows(inputs, record.measured, weight, counts)
                for inputs, record, weight, counts in zip(
                    self.inputs,
                    self.records,
                    weights,
                    self.divisions or [None] * len(self.records),
                    strict=True,
                )
            ]
            kept = self._kept["compared"] = (key, (loop, rows))
        return kept[1]

    @cached_property
    def _kept(self) -> dict[str, tuple[tuple[object, ...], tuple[MisfitLoop, list[Array]]]]:
        return {}

    @cached_property
    def _interpolates(self) -> bool:
        """Whether the state transition is interpolated between every few rows.

        This holds for the nominal model without substeps, if all records are sampled uniformly and
        their smoothed temperature is nearly linear between the computed transitions.
        """
        if self.model.terms or self.divisions is not None:
            return False
        return all(is_slow(record) for record in self.records)

    def states(self, values: Array, states: Sequence[Array]) -> list[Array]:
        """State trajectories, for each record (n_sample, n_state, n_lane)."""
        carries = [_lanes(state, values.shape[1]) for state in states]
        return self._sampled(_states_scan(self.model, self.plan)(self.inputs, values, carries)[1])


@lru_cache(_STRUCTURES)
def _logged_scan(model: MotorModel, plan: Plan, effort: Effort) -> Scan:
    return scan_of(step_function(model, plan), effort=effort)


@lru_cache(_STRUCTURES)
def _states_scan(model: MotorModel, plan: Plan) -> Scan:
    x, u, p = _symbols(model)
    return scan_of(
        ca.Function("states", [x, u, p], [advance(model, plan, x, u, p), x]), effort="once"
    )


@lru_cache(_STRUCTURES)
def _errors_scan(model: MotorModel, plan: Plan) -> Scan:
    """Loop that advances in half steps and outputs their difference from the whole step."""
    x, u, p = _symbols(model)
    step = ca.Function("step", [x, u, p], [advance(model, plan, x, u, p)])
    first, second = halves(u, model.held)
    end = step(step(x, first, p), second, p)
    return scan_of(
        ca.Function("errors", [x, u, p], [end, (end - step(x, u, p))[:2]]), effort="once"
    )


def _lanes(state: Array, count: int) -> Array:
    return np.repeat(state[:, None], count, axis=1) if state.ndim == 1 else state
