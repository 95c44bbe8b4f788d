"""One sample interval of a model, exact where the model is linear.

An exponential Rosenbrock step linearises the equations where the interval begins,

    x(t + h) = x + h phi1(h A) f + h^2 phi2(h A) df/dt,      A = df/dx,

and is exact for a linear motor with held or linear voltage, however stiff, since the
electrical time constant enters through the matrix functions and not through the step size.
For the nonlinear terms of effects it is of second order in h, and unlike Runge-Kutta methods it
stays stable when an effect adds stiffness (a steep brush drop, friction near standstill), since A
contains the effect.

The phi functions act on two vectors only, so their Taylor series costs one product of matrix and
vector a term.  Where h |A| is large the interval is divided, and where it is very large the
matrix functions themselves are formed by scaling and squaring,

    phi0(2z) = phi0(z)^2,  phi1(2z) = (phi0(z) + 1) phi1(z) / 2,
    phi2(2z) = (phi1(z)^2 + 2 phi2(z)) / 4.

Source: Hochbruck and Ostermann, Acta Numerica 19 (2010), 209-286, section 2.4 (exponential
Rosenbrock methods); Al-Mohy and Higham, SIAM J. Sci. Comput. 33 (2011), 488-511 (Taylor action).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import casadi as ca

from identification.model.composite import INPUTS, MotorModel
from identification.model.memory import memory_size, remembered
from identification.model.term import Expression

__all__ = ["Plan", "advance", "plan_for", "step_function", "transition_functions"]

TOLERANCE: Final = 1e-8
"""Largest truncated term of the Taylor series, relative to the change over the interval.

Sensors resolve 1e-2 to 1e-5 of the signal; this keeps the discretisation far below that even
after it has added up over a time constant."""

_LARGEST_DIVIDED: Final = 12.0

_SCALED: Final = 0.3
"""Size of the matrix whose functions are formed by series before they are doubled."""

_LARGEST_SERIES: Final = 5.0
"""The same where a term costs two multiplications and a doubling ten times that; the terms cancel
in two of sixteen digits here."""


@dataclass(frozen=True)
class Plan:
    """How one sample interval is computed.

    Args:
        parts: Equal parts the interval is divided into; A is formed anew in each.
        terms: Terms of the Taylor series.
        squarings: Doublings of scaling and squaring; 0 uses the action on vectors.
        rate: Largest h |A| that the plan is made for [-].
    """

    parts: int
    terms: int
    squarings: int = 0
    rate: float = 1.0

    def suits(self, rate: float) -> bool:
        """Whether the plan is enough for h |A| of `rate`, and not far more than enough."""
        return 0.2 * self.rate <= rate <= self.rate


def plan_for(rate: float, parts: int = 1, *, linear: bool = False) -> Plan:
    """The cheapest plan for an interval with h |A| of `rate` [-] and at least `parts` parts.

    Args:
        rate: Largest h |A| [-].
        parts: Parts that are asked for.
        linear: Whether the model is the declared one: then a term of the series costs two
            multiplications, and dividing the interval would gain nothing.
    """
    reach = _LARGEST_SERIES if linear else _LARGEST_DIVIDED
    if not math.isfinite(rate) or rate > reach * max(parts, 1):
        bounded = min(rate, 1e12) if math.isfinite(rate) else 1e12
        scaled = _LARGEST_SERIES if linear else _SCALED
        doublings = max(1, math.ceil(math.log2(bounded / parts / scaled)))
        return Plan(parts, _terms(bounded / parts / 2**doublings), doublings, bounded)
    if linear:
        return Plan(parts, _terms(rate / parts), 0, rate)
    costs = []
    for count in range(parts, parts + 16):
        terms = _terms(rate / count)
        costs.append((count * (2 * terms + 5), count, terms))
    _, count, terms = min(costs)
    return Plan(count, terms, 0, rate)


def _terms(z: float) -> int:
    """Terms after which the next term of the series is below the tolerance."""
    size, k = 1.0, 1
    while size > TOLERANCE or k < 3:
        k += 1
        size *= z / k
    return k


def step_function(model: MotorModel, plan: Plan) -> ca.Function:
    """SX function (carry, inputs, parameter) -> (carry at the next sample, logged now).

    The carry is the state, followed by what delayed channels remember (`memory.py`).
    """
    n = len(model.state_names)
    carry = ca.SX.sym("x", n + memory_size(model))
    inputs = ca.SX.sym("u", len(INPUTS))
    parameter = ca.SX.sym("p", len(model.parameters))
    state = carry[:n]
    advanced = advance(model, plan, state, inputs, parameter)
    logged = model.logged(state, inputs, parameter)
    if model.delays:
        end = _inputs_within(model, inputs, 1, 1)[0]
        memory, logged = remembered(
            model, (state, advanced), carry[n:], (inputs, end), parameter, logged
        )
        advanced = ca.vertcat(advanced, memory)
    return ca.Function("step", [carry, inputs, parameter], [advanced, logged])


def advance(
    model: MotorModel, plan: Plan, state: Expression, inputs: Expression, parameter: Expression
) -> Expression:
    """State at the end of the sample interval, (n_state,) expression."""
    x, u, p = (
        ca.SX.sym(name, symbol.numel())
        for name, symbol in (("x", state), ("u", inputs), ("p", parameter))
    )
    rates = model.rates(x, u, p)
    slope = ca.SX.sym("du", u.numel())
    linear = ca.Function(
        "linear",
        [x, u, p, slope],
        [rates, ca.jacobian(rates, x), ca.jtimes(rates, u, slope)],
    )
    interval = inputs[0] / plan.parts
    if state.numel() == 2:
        step = _by_characteristic
    else:
        step = _by_squaring if plan.squarings else _by_action
    for part in range(plan.parts):
        now, slopes = _inputs_within(model, inputs, part, plan.parts)
        f, jacobian, drift = linear(state, now, parameter, slopes * interval)
        state = state + step(jacobian, f, drift, interval, plan)
    return state


def _inputs_within(
    model: MotorModel, inputs: Expression, part: int, parts: int
) -> tuple[Expression, Expression]:
    """Inputs where a part of the interval begins, and their slopes [per second].

    The slope is multiplied by the length of a part before use, so an interval of zero length (the
    last sample of a record) never divides by zero.
    """
    column = {name: inputs[k] for k, name in enumerate(INPUTS)}
    # The reciprocal of an interval of zero length is replaced by zero: nothing moves in it.
    inverse = ca.if_else(column["interval"] > 0, 1 / column["interval"], 0)
    fraction = part / parts
    now, slope = [], []
    for name in INPUTS:
        following = f"{name}_next"
        change = column.get(following, column[name]) - column[name]
        if name == "temperature":
            # Held at its value in the middle of the part: with the linear change entering through
            # df/dt alone, A would be that of the start, an error of first order in the heating.
            now.append(column[name] + (fraction + 0.5 / parts) * change)
            slope.append(ca.SX(0))
        elif name in ("voltage", "angle") and not (name == "voltage" and model.held == "zoh"):
            now.append(column[name] + fraction * change)
            slope.append(change * inverse)
        elif name == "time":
            now.append(column[name] + fraction * column["interval"])
            slope.append(ca.SX(1))
        else:
            now.append(column[name])
            slope.append(ca.SX(0))
    return ca.vertcat(*now), ca.vertcat(*slope)


def _by_action(
    jacobian: Expression, f: Expression, drift: Expression, interval: Expression, plan: Plan
) -> Expression:
    """The increment by the Taylor series acting on vectors.

    `drift` is h df/dt, so that the interval appears to the same power in both vectors.
    """
    scaled = interval * jacobian
    # Horner's rule: the last vector of the sum, f + h df/dt / 2 + ..., is built from the inside.
    second = ca.mtimes(scaled, f) + drift
    total = second / plan.terms
    for k in range(plan.terms - 1, 1, -1):
        total = (second + ca.mtimes(scaled, total)) / k
    return interval * (f + total)


def _by_characteristic(
    jacobian: Expression, f: Expression, drift: Expression, interval: Expression, plan: Plan
) -> Expression:
    """The increment for two states, where Z^2 = tr(Z) Z - det(Z).

    Every power of Z = hA, and so every truncated series, is a + b Z with two scalars, and Horner's
    rule costs two multiplications a term.  The scalars do not depend on the state of a linear
    motor, so they are computed while the processor waits for the state of the step before.
    """
    z, _, phi1, phi2 = _pairs(jacobian, interval, plan)
    moved = phi1[0] * f + phi1[1] * ca.mtimes(z, f)
    return interval * (moved + phi2[0] * drift + phi2[1] * ca.mtimes(z, drift))


_Pair = tuple[Expression, Expression]
"""Scalars a, b of a + b Z."""


def _pairs(
    jacobian: Expression, interval: Expression, plan: Plan
) -> tuple[Expression, _Pair, _Pair, _Pair]:
    """Z, which is h A over the doublings of the plan, and phi0, phi1, phi2 of h A by Z."""
    z = jacobian * (interval / 2.0**plan.squarings)
    trace, determinant = z[0, 0] + z[1, 1], z[0, 0] * z[1, 1] - z[0, 1] * z[1, 0]

    def product(x: _Pair, y: _Pair) -> _Pair:
        both = x[1] * y[1]
        return (
            x[0] * y[0] - both * determinant,
            x[0] * y[1] + x[1] * y[0] + both * trace,
        )

    phi2 = (ca.SX(1 / math.factorial(plan.terms)), ca.SX(0))
    for k in range(plan.terms - 1, 1, -1):
        phi2 = (1 / math.factorial(k) - phi2[1] * determinant, phi2[0] + phi2[1] * trace)
    phi1 = (1 - phi2[1] * determinant, phi2[0] + phi2[1] * trace)
    phi0 = (1 - phi1[1] * determinant, phi1[0] + phi1[1] * trace)
    for _ in range(plan.squarings):
        square = product(phi1, phi1)
        phi2 = ((square[0] + 2 * phi2[0]) * 0.25, (square[1] + 2 * phi2[1]) * 0.25)
        doubled = product((phi0[0] + 1, phi0[1]), phi1)
        phi1 = (0.5 * doubled[0], 0.5 * doubled[1])
        phi0 = product(phi0, phi0)
    return z, phi0, phi1, phi2


def transition_functions(model: MotorModel, plan: Plan) -> tuple[ca.Function, ca.Function]:
    """The step of the declared model in two halves, for an interpolated loop.

    The first function (nothing, inputs, parameter) -> (nothing, transition) is what depends on
    the temperature, and so changes slowly; the second (state, inputs, transition) ->
    (state at the next sample, logged now) is what is left for each sample:

        x(t + h) = phi0(hA) x + h phi1(hA) g v + h phi2(hA) g (v(t + h) - v),    g = df/dv.
    """
    x, u, p = (
        ca.SX.sym("x", 2),
        ca.SX.sym("u", len(INPUTS)),
        ca.SX.sym("p", len(model.parameters)),
    )
    now, _ = _inputs_within(model, u, 0, 1)
    rates = model.rates(x, u, p)
    column = INPUTS.index("voltage")
    linear = ca.Function(
        "linear", [x, u, p], [ca.jacobian(rates, x), ca.jacobian(rates, u)[:, column]]
    )
    jacobian, gain = linear(ca.DM.zeros(2), now, p)
    z, phi0, phi1, phi2 = _pairs(jacobian, u[0], plan)
    one, pushed = ca.SX.eye(2), ca.mtimes(z, gain)
    parts = [ca.vec(phi0[0] * one + phi0[1] * z), u[0] * (phi1[0] * gain + phi1[1] * pushed)]
    if model.held == "foh":
        parts.append(u[0] * (phi2[0] * gain + phi2[1] * pushed))
    prepared = ca.vertcat(*parts)
    prepare = ca.Function("prepare", [ca.SX(0, 1), u, p], [ca.SX(0, 1), prepared])

    q = ca.SX.sym("q", prepared.numel())
    voltage = u[column]
    following = ca.mtimes(ca.reshape(q[:4], 2, 2), x) + q[4:6] * voltage
    if model.held == "foh":
        following = following + q[6:8] * (u[INPUTS.index("voltage_next")] - voltage)
    return prepare, ca.Function("step", [x, u, q], [following, x])


def _by_squaring(
    jacobian: Expression, f: Expression, drift: Expression, interval: Expression, plan: Plan
) -> Expression:
    """The increment by scaling and squaring of the matrix functions themselves."""
    n = jacobian.shape[0]
    one = ca.SX.eye(n)
    z = jacobian * (interval / 2.0**plan.squarings)
    phi2 = one / math.factorial(plan.terms + 2)
    for k in range(plan.terms + 1, 1, -1):
        phi2 = ca.mtimes(z, phi2) + one / math.factorial(k)
    phi1 = one + ca.mtimes(z, phi2)
    phi0 = one + ca.mtimes(z, phi1)
    for k in range(plan.squarings):
        phi2 = (ca.mtimes(phi1, phi1) + 2 * phi2) / 4
        phi1 = ca.mtimes(phi0 + one, phi1) / 2
        if k < plan.squarings - 1:
            phi0 = ca.mtimes(phi0, phi0)
    return interval * (ca.mtimes(phi1, f) + ca.mtimes(phi2, drift))
