"""How a small torque or voltage, given over time, moves what the sensors log.

Along the fitted trajectory the motor is linear, so the response to any number of forces costs one
pass through transitions that are computed once,

    dx(k+1) = F_k dx(k) + G_k f(k),      dy(k) = C_k dx(k),

with F, G and C the derivatives of the very step that is simulated.  Forces are constant within a
sample interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.fit.solve import Fit
from identification.model.composite import INPUTS, MotorModel
from identification.model.parameter import Parameter
from identification.model.scan import Scan, scan_of
from identification.model.simulate import Simulator
from identification.model.step import Plan, advance
from identification.model.term import (
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["responses"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Push(AbstractTorque, AbstractVoltage):
    """A voltage and a torque that stay what they are: states, so that derivatives by them exist."""

    name: ClassVar[str] = "push"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    states: ClassVar[tuple[State, ...]] = (State("voltage", "V"), State("torque", "N m"))

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """They do not move."""
        return [ca.SX(0), ca.SX(0)]

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Voltage [V]."""
        return states.voltage

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque [N m]."""
        return states.torque


def responses(fit: Fit, forces: Sequence[Array]) -> list[Array]:
    """What forces change in the logged channels, to first order.

    Args:
        fit: A model at its optimum.
        forces: For each record (n_sample, 2, n_lane) voltage [V] and torque [N m].

    Returns:
        For each record (n_sample, 2, n_lane) [A, rad/s].
    """
    simulator = Simulator.fitting(
        fit.simulator.model.adding(_Push()),
        fit.simulator.records,
        fit.values,
        fit.simulator.divisions,
    )
    n = len(fit.simulator.model.state_names)
    starts = [np.append(state, [0.0, 0.0])[:, None] for state in fit.states]
    scan = _transitions(simulator.model, simulator.plan)
    outputs = scan(simulator.inputs, fit.values[:, None], starts)[1]
    found = []
    for k, (output, force) in enumerate(zip(outputs, forces, strict=True)):
        flat = output[:, : n * (n + 2), 0]
        transitions = flat.reshape(-1, n + 2, n).transpose(0, 2, 1)
        logged = output[:, n * (n + 2) :, 0].reshape(-1, n, 2).transpose(0, 2, 1)
        rows = np.arange(force.shape[0])
        if simulator.divisions is not None:
            rows = np.repeat(rows, simulator.divisions[k])
        pushed = np.matmul(transitions[:, :, n:], force[rows])
        moved = np.empty((rows.size, n, force.shape[2]))
        state = np.zeros((n, force.shape[2]))
        matrices = np.ascontiguousarray(transitions[:, :, :n])
        for row in range(rows.size):
            moved[row] = state
            state = matrices[row] @ state + pushed[row]
        if simulator.divisions is not None:
            first = np.flatnonzero(np.diff(rows, prepend=-1))
            moved, logged = moved[first], logged[first]
        found.append(np.matmul(logged, moved))
    return found


@lru_cache(32)
def _transitions(model: MotorModel, plan: Plan) -> Scan:
    """The loop that puts out the derivatives of each step along the trajectory."""
    x = ca.SX.sym("x", len(model.state_names))
    u, p = ca.SX.sym("u", len(INPUTS)), ca.SX.sym("p", len(model.parameters))
    n = x.numel() - 2
    following = advance(model, plan, x, u, p)
    logged = model.logged(x, u, p)
    output = ca.vertcat(
        ca.vec(ca.jacobian(following[:n], x)), ca.vec(ca.jacobian(logged, x)[:, :n])
    )
    return scan_of(
        ca.Function("transitions", [x, u, p], [following, ca.densify(output)]), effort="once"
    )
