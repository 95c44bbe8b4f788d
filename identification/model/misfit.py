"""Compiled loop of the likelihood: simulate, whiten the residuals and sum their squares.

The carry holds the sums of squares and the states of the whitening filters after the model state,
so no time series is written.  For the nominal model with uniform sampling the state transition is
interpolated (see `loop.py`).  If all samples have unit weight, no weights are read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record
from identification.model.loop import STRIDE
from identification.model.scan import Scan, scan_of
from identification.model.step import step_function, transition_functions
from identification.model.step_plan import StepPlan
from identification.model.substeps import Substeps

__all__ = ["MisfitLoop", "is_slow", "misfit_loop"]

_STRAIGHT_DEGC: Final = 2e-3
"""Largest deviation of the temperature from linear interpolation between computed transitions; it
changes a resistance by less than 1e-5 of its value."""

_EVEN: Final = 1e-6
"""Largest relative difference between sample intervals that are treated as equal."""


@dataclass(frozen=True)
class MisfitLoop:
    """Compiled misfit loop and the layout of its input rows."""

    scan: Scan
    columns: tuple[int, ...]
    """Columns of the inputs on which the model depends."""
    weighted: bool
    """True if each row holds a weight for each channel."""

    def rows(
        self, inputs: Array, measured: Array, weights: Array, substeps: Substeps | None = None
    ) -> Array:
        """Input rows of the loop, (n_row, n_column).

        The inputs are (n_row, n_input), measured channels and weights (n_sample, 2); the
        weights are ignored if the loop is not weighted.
        """
        compared = np.column_stack([measured, weights]) if self.weighted else measured
        if substeps is None:
            return np.column_stack([inputs[:, self.columns], compared])
        is_sample = np.zeros(inputs.shape[0])
        is_sample[substeps.first_rows] = 1.0
        repeated = np.repeat(compared, substeps.counts, axis=0)
        return np.column_stack([inputs[:, self.columns], repeated, is_sample])


def misfit_loop(
    model: MotorModel,
    plan: StepPlan,
    orders: tuple[int, ...],
    *,
    weighted: bool,
    interpolated: bool,
    divided: bool = False,
) -> MisfitLoop:
    """Compile the misfit loop for the order of the whitening filter of each channel.

    The taps of the filters, without the first, which is 1, follow the parameters.  The transition
    is interpolated for the nominal model only; `weighted` says whether samples have weights,
    `divided` whether sample intervals have substeps.
    """
    columns, advancing, prepare = _reduced(model, plan, interpolated)
    x = ca.SX.sym("x", advancing.numel_in(0))
    u, p = ca.SX.sym("u", len(columns)), ca.SX.sym("p", advancing.numel_in(2))
    taps = [ca.SX.sym("c", order) for order in orders]
    measured, weight, sums = (ca.SX.sym(name, 2) for name in ("y", "w", "s"))
    is_sample = ca.SX.sym("is_sample")
    following, logged = advancing(x, u, p)
    carried, ends, total = [x, sums], [], []
    for channel, order in enumerate(orders):
        past = ca.SX.sym("e", order)
        now = ca.vertcat(measured[channel] - logged[channel], past)
        white = now[0] + ca.dot(taps[channel], past)
        counted = weight[channel] * white * white if weighted else white * white
        total.append(sums[channel] + (is_sample * counted if divided else counted))
        carried.append(past)
        shifted = ca.vertcat(*[now[lag] for lag in range(order)])
        ends.append(ca.if_else(is_sample > 0.5, shifted, past) if divided else shifted)
    row = ca.vertcat(u, measured, weight) if weighted else ca.vertcat(u, measured)
    row = ca.vertcat(row, is_sample) if divided else row
    nothing, both = ca.SX(0, 1), ca.vertcat(p, *taps)
    step = ca.Function(
        "misfit", [ca.vertcat(*carried), row, both], [ca.vertcat(following, *total, *ends), nothing]
    )
    wide: ca.Function | None = None
    if prepare is not None:
        own = ca.SX.sym("p", prepare.numel_in(2))
        _, prepared = prepare(nothing, u, own)
        given, passed = ca.vertcat(own, *taps), ca.vertcat(prepared, *taps)
        wide = ca.Function("prepare", [nothing, row, given], [nothing, passed])
    return MisfitLoop(scan_of(step, wide), columns, weighted)


def is_slow(record: Record) -> bool:
    """True if sampling is uniform and the temperature nearly linear over every `STRIDE` rows."""
    if record.rows < 3:
        return False
    rows = np.arange(record.rows - 1)
    nodes = np.union1d(rows[::STRIDE], rows[-1:])
    interval = record.column("interval")[:-1]
    middle = 0.5 * (record.column("temperature") + record.column("temperature_next"))[:-1]
    off = np.abs(np.interp(rows, nodes, middle[nodes]) - middle).max()
    uneven = np.abs(interval - interval[0]).max()
    return bool(off <= _STRAIGHT_DEGC and uneven <= _EVEN * interval[0])


def _reduced(
    model: MotorModel, plan: StepPlan, interpolated: bool
) -> tuple[tuple[int, ...], ca.Function, ca.Function | None]:
    """Input columns in use, and step and preparation as functions of these columns only."""
    functions = [step_function(model, plan)]
    if interpolated:
        prepare, step = transition_functions(model, plan)
        functions = [step, prepare]
    used = {
        k for f in functions for output in range(2) for k in f.jac_sparsity(output, 1).get_col()
    }
    columns = tuple(sorted(used))
    few = ca.SX.sym("u", len(columns))
    row = ca.SX.zeros(len(INPUTS))
    for index, k in enumerate(columns):
        row[k] = few[index]
    reduced = []
    for f in functions:
        carry = ca.SX.sym("x", f.size1_in(0))
        parameter = ca.SX.sym("p", f.numel_in(2))
        results = list(f(carry, row, parameter))
        reduced.append(ca.Function(f.name(), [carry, few, parameter], results))
    return columns, reduced[0], reduced[1] if interpolated else None
