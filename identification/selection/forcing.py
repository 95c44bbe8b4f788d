"""Linearised response of the logged channels to small additive torques and voltages.

The model is linearised along the fitted trajectory, so the responses to any number of forces cost
one pass through transition matrices that are computed once:

    dx(k+1) = F_k dx(k) + G_k f(k),      dy(k) = C_k dx(k)

F, G and C are the derivatives of the integration step that the simulator uses.  The forces f are
constant within a sample interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.fit.solve import Fit
from identification.model.blocks import single
from identification.model.composite import MotorModel
from identification.model.excitation import Record
from identification.model.scan import Scan, scan_of
from identification.model.step import advance
from identification.model.step_plan import StepPlan
from identification.model.substeps import Substeps
from identification.model.term import (
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    State,
    Values,
)
from identification.work import TOUCH, charge

__all__ = ["responses", "trajectory"]

_PASSES = 4.0
"""Reads and writes of each force value in a response, for the count of operations."""


@dataclass(frozen=True)
class _Push(AbstractTorque, AbstractVoltage):
    """Constant voltage and torque, as states, to differentiate the step with respect to them."""

    name = "push"
    equation = "mechanical"
    drivers = ()
    parameters = ()
    states = (State("voltage", "V"), State("torque", "N m"))

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return states.voltage

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return states.torque


def trajectory(fit: Fit, k: int) -> tuple[Record, Array, Array]:
    """Record `k`, and current [A] and speed [rad/s] (n_sample,) as simulated by a fit."""
    simulator = fit.simulator
    record, substeps = simulator.records[k], simulator.substeps
    own = replace(simulator, records=(record,), substeps=substeps and (substeps[k],))
    states = own.states(fit.values[:, None], fit.states[k : k + 1])[0]
    return record, states[:, 0, 0], states[:, 1, 0]


def responses(fit: Fit, forces: Callable[[int], Array], stride: int = 1) -> Iterator[Array]:
    """First-order changes of current and speed by forces at the optimum of a fit, record by record.

    The changes are (n_kept, 2, n_lane) [A, rad/s] at every `stride`-th sample.  `forces` returns
    those of a record by its index, (n_sample, 2, n_lane) voltage [V] and torque [N m].
    """
    simulator = fit.simulator.changed_to(fit.simulator.model.adding(_Push()), fit.values)
    n = len(fit.simulator.model.state_names)
    scan = _transitions(simulator.model, simulator.plan)
    for k, state in enumerate(fit.states):
        start = np.append(state, [0.0, 0.0])[:, None]
        output = single(scan, simulator.inputs[k], fit.values[:, None], start)
        substeps = None if simulator.substeps is None else simulator.substeps[k]
        yield _response(output, n, forces(k), substeps, stride)


def _response(output: Array, n: int, force: Array, substeps: Substeps | None, stride: int) -> Array:
    """Response in one record from its transition matrices, at every `stride`-th sample."""
    charge(_PASSES * TOUCH * (output.size + force.size))
    transitions = output[:, : n * (n + 2)].reshape(-1, n + 2, n).transpose(0, 2, 1)
    logged = output[:, n * (n + 2) :].reshape(-1, n, 2).transpose(0, 2, 1)
    first = np.arange(force.shape[0]) if substeps is None else substeps.first_rows
    kept = np.arange(0, force.shape[0], stride)
    # Rows between two kept samples are composed to one transition, for all such spans at once.
    starts = first[kept]
    stops = np.append(starts[1:], output.shape[0])
    samples = np.repeat(np.arange(force.shape[0]), np.diff(np.append(first, output.shape[0])))
    matrices = np.repeat(np.eye(n)[None], kept.size, axis=0)
    pushed = np.zeros((kept.size, n, force.shape[2]))
    for ahead in range(int((stops - starts).max())):
        rows = starts + ahead
        on = rows < stops
        here = transitions[rows[on]]
        matrices[on] = here[:, :, :n] @ matrices[on]
        pushed[on] = here[:, :, :n] @ pushed[on] + here[:, :, n:] @ force[samples[rows[on]]]
    state = np.zeros((n, force.shape[2]))
    states = np.empty_like(pushed)
    for k in range(kept.size):
        states[k] = state
        state = matrices[k] @ state + pushed[k]
    return np.asarray(logged[starts] @ states)


@lru_cache(32)
def _transitions(model: MotorModel, plan: StepPlan) -> Scan:
    """Compiled loop that outputs the Jacobians of each step along the trajectory."""
    x, u, p = model.symbols()
    n = x.numel() - 2
    following = advance(model, plan, x, u, p)
    logged = model.logged(x, u, p)
    output = ca.vertcat(
        ca.vec(ca.jacobian(following[:n], x)), ca.vec(ca.jacobian(logged, x)[:, :n])
    )
    return scan_of(
        ca.Function("transitions", [x, u, p], [following, ca.densify(output)]), effort="once"
    )
