"""Output-error simulation of a model over records, for many parameter vectors at once.

    simulator = Simulator.fitting(model, records, values)
    fine = simulator.accurate(values, states, noise)
    fine.logged(lanes, states)              simulated sensor readings

Parameters are physical values: `values` is (n_parameter,), `lanes` is (n_parameter, n_lane).

The simulator owns its accuracy: the step plan (`step_plan.py`) and the substeps (`substeps.py`).
Both are fixed during an optimisation, so that the cost is a smooth function of the parameters.
`suited_to` renews the step plan and `accurate` the substeps, at the values that a fit has reached.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np

from identification.arrays import Array, Index
from identification.model.blocks import logged_scan, sampled, states_scan, stretch
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record, rms_of
from identification.model.history import initial_history
from identification.model.misfit import MisfitLoop, is_slow, misfit_loop
from identification.model.scan import Effort
from identification.model.step_plan import StepPlan, plan_for, stiffness
from identification.model.substeps import (
    FINER,
    MOST_SUBSTEPS,
    ROUNDS,
    Substeps,
    divided,
    errors_of,
    evenly,
    refined,
    settled,
)
from identification.model.weighting import Weighting

__all__ = ["Simulator", "initial_states"]

_MARGIN: Final = 1.5
"""Stiffness that a step plan covers, over the stiffness at the values it is made for."""
_ROUGH: Final = 0.1
"""Error of one sample interval over the noise, where starting points are compared."""
_LOCAL: Final = 0.02
"""Error of one sample interval over the noise, from which accurate substeps are searched."""
_TOTAL: Final = 0.05
"""RMS discretisation error over the noise [-] that is accepted; it raises a residual by 0.1 %."""
_CONVERGED: Final = 3e-9
"""Error of one sample interval of a converged simulation, over the range of the signal."""
_AGREED: Final = 1.5e-7
"""Difference from a finer simulation that a converged one may have, over the same range."""
_FINEST, _MOST_ROWS = 4096, 2**21
"""Limits of a converged simulation: substeps of an interval, and of all records."""


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


@dataclass(frozen=True)
class Simulator:
    """Model prepared for simulation over records."""

    model: MotorModel
    records: tuple[Record, ...]
    plan: StepPlan
    substeps: tuple[Substeps, ...] | None = None
    """Substeps of the sample intervals of each record; None for one each."""

    @cached_property
    def inputs(self) -> list[Array]:
        """Inputs of each record (n_row, n_input), one row per substep."""
        shifted = [self._shifted(record.inputs) for record in self.records]
        if self.substeps is None:
            return shifted
        pairs = zip(shifted, self.substeps, strict=True)
        return [divided(inputs, substeps, self.model.held) for inputs, substeps in pairs]

    @cached_property
    def first_rows(self) -> list[Index] | None:
        """Row index of each sample, for each record; None if every row is a sample."""
        return None if self.substeps is None else [each.first_rows for each in self.substeps]

    def stretch(self, k: int, samples: slice) -> tuple[Array, Index | None]:
        """Inputs of a range of samples of record `k`; see `blocks.stretch`."""
        at = None if self.first_rows is None else self.first_rows[k]
        return stretch(self.inputs[k], at, samples)

    def _shifted(self, inputs: Array) -> Array:
        """Inputs with the voltage advanced by `model.advance` samples."""
        ahead = self.model.advance
        if not ahead:
            return inputs
        shifted, logged = inputs.copy(), inputs[:, INPUTS.index("voltage")]
        for later, name in enumerate(("voltage", "voltage_next")):
            rows = np.clip(np.arange(logged.size) + ahead + later, 0, logged.size - 1)
            shifted[:, INPUTS.index(name)] = logged[rows]
        return shifted

    def carries(self, states: Sequence[Array], lanes: int) -> list[Array]:
        """Carry before the first sample of each record, (n_state + n_history, n_lane)."""
        return [
            np.concatenate(
                [_lanes(state, lanes), _lanes(initial_history(self.model, record.head), lanes)]
            )
            for state, record in zip(states, self.records, strict=True)
        ]

    @staticmethod
    def fitting(
        model: MotorModel,
        records: Sequence[Record],
        values: Array,
        substeps: tuple[Substeps, ...] | None = None,
    ) -> Simulator:
        """Simulator with a step plan for `values`, (n_parameter,) or (n_parameter, n_lane).

        The plan is for the stiffest lane.  Edge samples that the model cannot predict lose weight.
        """
        states = [initial_states(model, record) for record in records]
        stiffest = stiffness(model, records, values, states)
        known = tuple(record.within(model.edges) for record in records)
        plan = plan_for(_MARGIN * stiffest, linear=not model.terms)
        return Simulator(model, known, plan, substeps)

    def changed_to(self, model: MotorModel, values: Array) -> Simulator:
        """Simulator of another model over the same records, with the same substeps.

        Its step plan is for `values`, (n_parameter,) or (n_parameter, n_lane).
        """
        return Simulator.fitting(model, self.records, values, self.substeps)

    def suited_to(self, values: Array) -> Simulator:
        """Simulator whose step plan suits `values`; this one if its plan does."""
        states = [initial_states(self.model, record) for record in self.records]
        if self.plan.suits(stiffness(self.model, self.records, values, states)):
            return self
        return self.changed_to(self.model, values)

    def roughly_accurate(
        self, values: Array, states: Sequence[Array], deviation: Array, rounds: int = ROUNDS
    ) -> Simulator:
        """Simulator with an error below a tenth of the noise in each sample interval.

        This suffices to compare starting points.  The arguments are those of `with_tolerance`.
        """
        close = _ROUGH * deviation
        return self.with_tolerance(values, states, close, rounds) if self.model.terms else self

    def accurate(self, values: Array, states: Sequence[Array], deviation: Array) -> Simulator:
        """Simulator with the fewest substeps whose discretisation error the noise hides.

        A single interval may be wrong by a fiftieth of the noise.  How such errors accumulate is
        measured with an eight times smaller tolerance.  If the two differ, the finer one is tested
        in the same way, up to three times.  The arguments are those of `with_tolerance`, with the
        noise (2,) of current and speed [A, rad/s].
        """
        return self._settled(values, states, _LOCAL * deviation, partial(self._hidden, deviation))

    def finer(self, values: Array, states: Sequence[Array], deviation: Array) -> Simulator:
        """Simulator with an eighth of the tolerance that `accurate` tries first."""
        return self.with_tolerance(values, states, _LOCAL / FINER * deviation)

    def differs_from(
        self, other: Simulator, values: Array, states: Sequence[Array], deviation: Array
    ) -> bool:
        """True if a channel differs by an RMS of more than a twentieth of the noise."""
        mine, others = (one.logged(values[:, None], states) for one in (self, other))
        return not self._hidden(deviation, mine, others)

    def _hidden(self, deviation: Array, one: Sequence[Array], other: Sequence[Array]) -> bool:
        differences = [(a - b)[:, :, 0] for a, b in zip(one, other, strict=True)]
        return bool(np.all(rms_of(self.records, differences) < _TOTAL * deviation))

    def converged(self, values: Array, states: Sequence[Array]) -> Simulator:
        """Simulator whose discretisation error is below a millionth of the signals.

        Errors accumulate in an angle, and a shaft that almost stops amplifies them.  The simulation
        is therefore compared with one of an eight times smaller tolerance, as in `accurate`.  Long
        records have fewer substeps, which bounds the memory.  The arguments are those of
        `with_tolerance`.
        """
        span = np.max([record.span for record in self.records], axis=0)
        rows = sum(record.rows for record in self.records)
        most = int(np.clip(_MOST_ROWS // rows, MOST_SUBSTEPS, _FINEST))

        def agree(one: Sequence[Array], other: Sequence[Array]) -> bool:
            pairs = zip(one, other, strict=True)
            return not any(np.any(np.abs(a - b)[:, :, 0] > _AGREED * span) for a, b in pairs)

        return self._settled(values, states, _CONVERGED * span, agree, rounds=2, most=most)

    def _settled(
        self,
        values: Array,
        states: Sequence[Array],
        tolerance: Array,
        agree: Callable[[Sequence[Array], Sequence[Array]], bool],
        **limits: int,
    ) -> Simulator:
        substeps, measured = self._errors_at(values, states)

        def readings(tried: tuple[Substeps, ...]) -> list[Array]:
            return self._with(tried).logged(values[:, None], states)

        return self._with(settled(substeps, measured, tolerance, readings, agree, **limits))

    def with_tolerance(
        self,
        values: Array,
        states: Sequence[Array],
        tolerance: Array,
        rounds: int = ROUNDS,
        most: int = MOST_SUBSTEPS,
    ) -> Simulator:
        """Refine the substeps until each sample interval meets the tolerance at `values`.

        The values are (n_parameter,) physical, the state of each record is (n_state,) at its first
        sample, the tolerance is the allowed error of current and speed per sample interval (2,) [A,
        rad/s].  Errors are measured `rounds` times at most; no substep is shorter than its interval
        over `most`.
        """
        substeps, measured = self._errors_at(values, states)
        return self._with(refined(substeps, measured, tolerance, rounds, most)[0])

    def _errors_at(
        self, values: Array, states: Sequence[Array]
    ) -> tuple[tuple[Substeps, ...], Callable[[Sequence[Substeps]], list[Array]]]:
        """Present substeps, and the function that measures the errors of any substeps."""
        inputs = [self._shifted(record.inputs) for record in self.records]
        start = values[:, None], [_lanes(state, 1) for state in states]
        substeps = self.substeps or evenly([each.rows for each in self.records], 1)
        return substeps, partial(errors_of, (self.model, self.plan), inputs, start)

    def _with(self, substeps: tuple[Substeps, ...]) -> Simulator:
        """Simulator with other substeps; this one if they are its own."""
        found = None if all(each.rows == each.counts.size for each in substeps) else substeps
        return self if found is self.substeps else replace(self, substeps=found)

    @property
    def steps(self) -> int:
        """Number of integration steps of one simulation of all records."""
        if self.substeps is None:
            return sum(record.rows for record in self.records)
        return sum(each.rows for each in self.substeps)

    @property
    def n_state(self) -> int:
        """Number of states."""
        return len(self.model.state_names)

    def logged(
        self, values: Array, states: Sequence[Array], effort: Effort = "some"
    ) -> list[Array]:
        """Simulated sensor readings (n_sample, 2, n_lane) of each record [A, rad/s].

        The values are (n_parameter, n_lane) physical, the state of each record at its first sample
        is (n_state,) or (n_state, n_lane); the effort is that of a `Scan`.
        """
        scan = logged_scan(self.model, self.plan, effort)
        carries = self.carries(states, values.shape[1])
        return sampled(scan, self.inputs, self.first_rows, values, carries)

    def misfit(self, values: Array, states: Sequence[Array], weighting: Weighting) -> Array:
        """Weighted sums of squares of the whitened residuals, (2, n_lane) [A^2, rad^2/s^2].

        A likelihood evaluation consists of one such call.  The sums are part of the carry, so no
        time series is written to memory.  They are not divided by the variances of the noise model.
        Values and states are those of `logged`.
        """
        loop, rows = self._compared(weighting)
        starts = self.carries(states, values.shape[1])
        own = starts[0].shape[0]
        sums = np.zeros((loop.scan.n_carry - own, values.shape[1]))
        taps = np.concatenate([each[1:] for each in weighting.whitening])
        both = np.concatenate([values, np.repeat(taps[:, None], values.shape[1], axis=1)])
        finals, _ = loop.scan(rows, both, [np.concatenate([x, sums]) for x in starts])
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
            kept = self._kept["compared"] = (key, self._misfit_loop(weighting))
        return kept[1]

    def _misfit_loop(self, weighting: Weighting) -> tuple[MisfitLoop, list[Array]]:
        """Misfit loop and rows, as above.

        The state transition is interpolated for the nominal model without substeps, if all records
        are sampled uniformly and their smoothed temperature is nearly linear between the computed
        transitions.
        """
        weights = [weighting.sample_weights(k) for k in range(len(self.records))]
        is_plain = not self.model.terms and self.substeps is None
        loop = misfit_loop(
            self.model,
            self.plan,
            tuple(taps.size - 1 for taps in weighting.whitening),
            weighted=any(np.any(weight != 1.0) for weight in weights),
            interpolated=is_plain and all(is_slow(record) for record in self.records),
            divided=self.substeps is not None,
        )
        substeps: Sequence[Substeps | None] = self.substeps or [None] * len(self.records)
        given = zip(self.inputs, self.records, weights, substeps, strict=True)
        return loop, [loop.rows(rows, one.measured, w, each) for rows, one, w, each in given]

    @cached_property
    def _kept(self) -> dict[str, tuple[tuple[object, ...], tuple[MisfitLoop, list[Array]]]]:
        return {}

    def states(
        self, values: Array, states: Sequence[Array], *, of_substeps: bool = False
    ) -> list[Array]:
        """State of each sample or at the begin of each substep, (n_row, n_state, n_lane)."""
        carries = [_lanes(state, values.shape[1]) for state in states]
        rows = None if of_substeps else self.first_rows
        return sampled(states_scan(self.model, self.plan), self.inputs, rows, values, carries)


def _lanes(state: Array, count: int) -> Array:
    return np.repeat(state[:, None], count, axis=1) if state.ndim == 1 else state
