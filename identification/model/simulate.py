"""Simulation of a model over records, many parameter vectors at once.

    simulator = Simulator(model, records, values)
    simulator.logged(values, states)        what the sensors would log

`values` are physical parameters, (n_parameter,) or (n_parameter, n_lane).
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
    """Where a record most plausibly starts, (n_state,): logged current and speed, steady rest."""
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
    """A model made ready to be simulated over records.

    Args:
        model: The model.
        records: What drives it.
        plan: How a part of a sample interval is computed; see `plan_for`.
        divisions: For each record (n_sample,) parts of each sample interval; None for one.
    """

    model: MotorModel
    records: tuple[Record, ...]
    plan: Plan
    divisions: tuple[Counts, ...] | None = None

    @cached_property
    def inputs(self) -> list[Array]:
        """Inputs of each record (n_row, n_input), a row for each part of a sample interval."""
        shifted = [self._shifted(record.inputs) for record in self.records]
        if self.divisions is None:
            return shifted
        pairs = zip(shifted, self.divisions, strict=True)
        return [divided(inputs, counts, self.model.held) for inputs, counts in pairs]

    @cached_property
    def begins(self) -> list[NDArray[np.intp]] | None:
        """For each record the rows at which samples lie; None where every row is a sample."""
        return None if self.divisions is None else [begins(c) for c in self.divisions]

    def _sampled(self, rows: list[Array]) -> list[Array]:
        """Of arrays with a value for each part, those at the samples."""
        if self.begins is None:
            return rows
        return [y[at] for y, at in zip(rows, self.begins, strict=True)]

    def _shifted(self, inputs: Array) -> Array:
        """Inputs with the voltage as many samples ahead as the model asks."""
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
        """Carry before the first sample of each record (n_state + n_memory, n_lane)."""
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
        """A simulator whose plan suits `values`, with room for rates `margin` times higher."""
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
        """This simulator with its sample intervals divided until each is accurate.

        The error of a part is what two halves of it change, measured at `values`.

        Args:
            values: (n_parameter,) physical.
            states: For each record (n_state,) at its first sample.
            tolerance: (2,) error of current and speed that one interval may have [A, rad/s].
            looks: How often the error is measured.
            start: Parts to start from; one where absent.
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
        """For each record (n_row, 2) what halving changes in current and speed over each part."""
        carries = [_lanes(state, 1) for state in states]
        errors = _errors_scan(self.model, self.plan)(self.inputs, values[:, None], carries)[1]
        return [error[:, :, 0] for error in errors]

    @staticmethod
    def rate(model: MotorModel, records: Sequence[Record], values: Array) -> float:
        """Largest h |df/dx| where the measured current and speed pass through [-]."""
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
        """What the sensors would log.

        Args:
            values: (n_parameter, n_lane) physical.
            states: For each record (n_state,) or (n_state, n_lane) at its first sample.
            effort: How much the loop is worked on before it runs; see `Scan`.

        Returns:
            For each record (n_sample, 2, n_lane) [A, rad/s].
        """
        scan = _logged_scan(self.model, self.plan, effort)
        carries = self.carries(states, values.shape[1])
        return self._sampled(scan(self.inputs, values, carries)[1])

    def misfit(self, values: Array, states: Sequence[Array], weighting: Weighting) -> Array:
        """Weighted sums of squares of the whitened residuals, (2, n_lane) [A^2, rad^2/s^2].

        The sums are kept in the carry, so that nothing is written to memory on the way; this is
        what a likelihood costs.

        Args:
            values: (n_parameter, n_lane) physical.
            states: For each record (n_state,) or (n_state, n_lane).
            weighting: Noise model; its deviations are not applied.
        """
        loop, rows = self._compared(weighting)
        starts = self.carries(states, values.shape[1])
        own = starts[0].shape[0]
        sums = np.zeros((loop.scan.n_carry - own, values.shape[1]))
        finals, _ = loop.scan(rows, values, [np.concatenate([x, sums]) for x in starts])
        return np.asarray(np.sum([f[own : own + 2] for f in finals], axis=0))

    def misfit_work(self, lanes: int, weighting: Weighting) -> float:
        """Operations of one call of `misfit` with so many lanes."""
        loop, rows = self._compared(weighting)
        return sum(loop.scan.work(each.shape[0], lanes) for each in rows)

    def _compared(self, weighting: Weighting) -> tuple[MisfitLoop, list[Array]]:
        """The loop for a noise model, and what it reads of each record.

        Both are the same from call to call while only deviations change, and copying the rows
        costs as much as simulating a block of lanes; so the last ones are kept.
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
        """Whether the transition may move along straight lines between every few rows.

        It may for the declared model, where samples are even in time and the temperature is as
        smooth as it should be after `smooth_temperature`.
        """
        if self.model.terms or self.divisions is not None:
            return False
        return all(is_slow(record) for record in self.records)

    def states(self, values: Array, states: Sequence[Array]) -> list[Array]:
        """All states over time, for each record (n_sample, n_state, n_lane)."""
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
    """The loop that goes on in halves and puts out what the whole would change."""
    x, u, p = _symbols(model)
    step = ca.Function("step", [x, u, p], [advance(model, plan, x, u, p)])
    first, second = halves(u, model.held)
    end = step(step(x, first, p), second, p)
    return scan_of(
        ca.Function("errors", [x, u, p], [end, (end - step(x, u, p))[:2]]), effort="once"
    )


def _lanes(state: Array, count: int) -> Array:
    return np.repeat(state[:, None], count, axis=1) if state.ndim == 1 else state
