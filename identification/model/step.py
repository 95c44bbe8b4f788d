"""Exponential Rosenbrock integration of one sample interval (method exprb32).

The step linearises the equations at the start of the interval,

    x_1 = x + h phi1(h A) f + h^2 phi2(h A) df/dt,      f = dx/dt,  A = df/dx.

It is exact for a linear motor with held or linearly varying voltage, however stiff, because the
electrical time constant enters through the matrix functions and not through the step size.
Unlike explicit Runge-Kutta methods it stays stable when an effect adds stiffness (a steep brush
drop, friction near standstill), because A includes the effect.  If the model is nonlinear, the
error d of the linearisation at the end of the interval gives a correction,

    d = f(x_1) - f(x) - A (x_1 - x) - h df/dt,     x(t + h) = x_1 + 2 h phi3(h A) d,

which makes the step third-order accurate.

The phi functions act on a few vectors only, so their Taylor series cost one matrix-vector product
per term.  If h |A| is large, the matrix functions themselves are computed by scaling and squaring,

    phi_l(2z) = (phi0(z) phi_l(z) + sum_{k=1..l} phi_k(z) / (l - k)!) / 2^l.

Source: Hochbruck and Ostermann, Acta Numerica 19 (2010), 209-286, section 2.4 (exponential
Rosenbrock methods, here the pair called exprb32); Al-Mohy and Higham, SIAM J. Sci. Comput. 33
(2011), 488-511 (Taylor action).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache, partial
from typing import Any

import casadi as ca

from identification.arrays import Array
from identification.model.composite import INPUTS, Hold, MotorModel
from identification.model.history import Moment, history_size, shares_before, updated_history
from identification.model.step_plan import StepPlan
from identification.model.term import Expression

__all__ = ["advance", "part_of_interval", "step_function", "transition_functions"]


@lru_cache
def step_function(model: MotorModel, plan: StepPlan) -> ca.Function:
    """SX function (carry, inputs, parameter) -> (carry at the next sample, readings at this one).

    The carry is the state, followed by the history of delayed and averaged channels (`history.py`).
    """
    n, averaged = len(model.state_names), tuple(model.averaged)
    carry, inputs, parameter = model.symbols(history_size(model))
    state = carry[:n]
    end = advance(model, plan, state, inputs, parameter, averaged)
    if not model.has_history:
        logged = model.logged(state, inputs, parameter)
        return ca.Function("step", [carry, inputs, parameter], [end, logged])
    columns, instants = ca.vertsplit(inputs), []
    for share in shares_before(model, inputs, parameter):
        row, later = (
            ca.vertcat(*part_of_interval(columns, model.held, *part).values())
            for part in ((0.0, share), (share, 1.0))
        )
        states = advance(model, plan, state, row, parameter, averaged)
        instants.append(Moment(states, later))
    history, logged = updated_history(
        model, carry[n:], (Moment(state, inputs), end, instants), parameter
    )
    advanced = ca.vertcat(end[:n], history)
    return ca.Function("step", [carry, inputs, parameter], [advanced, logged])


def part_of_interval(
    inputs: Iterable[Any], hold: Hold, begin: Any, share: Any
) -> dict[str, Array | Expression]:
    """Inputs of a part of an interval, as fractions of it; arrays or expressions."""
    row = dict(zip(INPUTS, inputs, strict=True))
    moving = ("voltage", "temperature", "angle") if hold == "foh" else ("temperature", "angle")
    for name in moving:
        start = row[name]
        change = row[f"{name}_next"] - start
        row[name] = start + change * begin
        row[f"{name}_next"] = start + change * (begin + share)
    whole = row["interval"]
    row["time"] = row["time"] + whole * begin
    row["interval"], row["turn"] = whole * share, row["turn"] * share
    row["substeps"] = row["substeps"] / share
    return row


def advance(
    model: MotorModel,
    plan: StepPlan,
    state: Expression,
    inputs: Expression,
    parameter: Expression,
    integrated: Sequence[int] = (),
) -> Expression:
    """State at the end of the sample interval, followed by integrals over the interval.

    The state is (n_state,) at the start; `integrated` are the indices of the logged channels to
    integrate, as additional states.  The result is an expression (n_state + n_integrated,).
    """
    n = state.numel()
    state = ca.vertcat(state, *[0] * len(integrated))
    x, u, p = model.symbols(len(integrated))
    rates = model.rates(x[:n], u, p, is_averaged=True)
    if integrated:
        logged = model.logged(x[:n], u, p)
        rates = ca.vertcat(rates, *[logged[channel] for channel in integrated])
    jacobian = ca.jacobian(rates, x)
    slope = ca.SX.sym("du", u.numel())
    linear = ca.Function("linear", [x, u, p, slope], [rates, jacobian, ca.jtimes(rates, u, slope)])
    interval = inputs[0]
    is_averaged = bool(ca.depends_on(rates, u[INPUTS.index("turn")]))
    now, slopes = _inputs_within(model.held, is_averaged=is_averaged)(inputs)
    f, matrix, drift = linear(state, now, parameter, slopes * interval)
    prepare, moves, corrects = _increments(matrix.sparsity().serialize(), plan)
    prepared = prepare.call([matrix, interval])
    moved = moves(*prepared, interval, f, drift)
    if not _is_curved(rates, x, u, is_averaged=is_averaged):
        return state + moved
    ends = state + moved, now + interval * slopes, parameter
    at_end = ca.Function("rates", [x, u, p], [rates])(*ends)
    missed = at_end - f - ca.mtimes(matrix, moved) - drift
    return state + moved + corrects(*prepared, interval, missed)


def _is_curved(
    rates: Expression, state: Expression, inputs: Expression, *, is_averaged: bool
) -> bool:
    """True if the rates are nonlinear in the state or in inputs that vary within an interval."""
    names = ("voltage", "time") if is_averaged else ("voltage", "time", "angle")
    moving = [inputs[k] for k, name in enumerate(INPUTS) if name in names]
    moved = ca.vertcat(state, *moving)
    return bool(ca.depends_on(ca.jacobian(rates, moved), moved))


@lru_cache
def _inputs_within(hold: Hold, *, is_averaged: bool = False) -> ca.Function:
    """Inputs (n_input,) -> inputs at the start of the interval and their slopes [1/s].

    The reciprocal of a zero length (the last interval of a record) is replaced by zero, so nothing
    divides by zero.  With `is_averaged` a torque is averaged over the angle, which is then the
    middle one.
    """
    inputs = ca.SX.sym("u", len(INPUTS))
    columns: list[Expression] = ca.vertsplit(inputs)
    column = dict(zip(INPUTS, columns, strict=True))
    inverse = ca.if_else(column["interval"] > 0, 1 / column["interval"], 0)
    now, slope = [], []
    for name in INPUTS:
        change = column.get(f"{name}_next", column[name]) - column[name]
        # Held at its mid-interval value.  A linear change would enter through df/dt alone and
        # leave A at the start temperature, a first-order error in the heating.
        is_middle = name == "temperature" or (name == "angle" and is_averaged)
        is_linear = name == "angle" or (name == "voltage" and hold == "foh")
        share = 0.5 if is_middle else float(name == "voltage" and hold == "late")
        now.append(column[name] + share * change if share else column[name])
        held = ca.SX(1 if name == "time" else 0)
        slope.append(change * inverse if is_linear and not is_middle else held)
    return ca.Function("within", [inputs], [ca.vertcat(*now), ca.vertcat(*slope)])


@lru_cache
def _increments(sparsity: str, plan: StepPlan) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Functions of a prepared matrix, of the increment and of the correction of a step.

    The increment is h (phi1 f + phi2 h df/dt), the correction 2 h phi3 d.  They depend on a model
    only through the nonzeros of A, so many models share them.
    """
    matrix, interval = ca.SX.sym("A", ca.Sparsity.deserialize(sparsity)), ca.SX.sym("h")
    n = matrix.shape[0]
    f, drift, missed = (ca.SX.sym(name, n) for name in ("f", "drift", "d"))
    if n == 2:
        z, _, *phis = _pairs(matrix, interval, plan)
        prepared, apply = [z, *(ca.vertcat(*phi) for phi in phis)], _by_characteristic
    elif plan.squarings:
        prepared, apply = list(_squared(matrix, interval, plan)), _by_functions
    else:
        prepared, apply = [interval * matrix], partial(_by_action, plan.terms)
    given = [ca.SX.sym("phi", part.sparsity()) for part in prepared]
    moved, corrected = apply(given, (f, drift, missed))
    return (
        ca.Function("prepared", [matrix, interval], prepared),
        ca.Function("moves", [*given, interval, f, drift], [interval * moved]),
        ca.Function("corrects", [*given, interval, missed], [2 * interval * corrected]),
    )


_Vectors = tuple[Expression, Expression, Expression]
"""The vectors f, h df/dt and d."""


def _by_action(
    terms: int, prepared: Sequence[Expression], vectors: _Vectors
) -> tuple[Expression, Expression]:
    """Increment and correction over h by Taylor series applied to vectors, with Horner's rule.

    The vector h df/dt contains the interval, so it has the same power in both vectors.
    """
    (scaled,), (f, drift, missed) = prepared, vectors
    second = ca.mtimes(scaled, f) + drift
    total = second / terms
    for k in range(terms - 1, 1, -1):
        total = (second + ca.mtimes(scaled, total)) / k
    rest: Expression = missed
    for k in range(terms + 2, 3, -1):
        image: Expression = ca.mtimes(scaled, rest)
        rest = missed + image / k
    return f + total, rest / 6


def _by_characteristic(
    prepared: Sequence[Expression], vectors: _Vectors
) -> tuple[Expression, Expression]:
    """Increment and correction over h for two states: Cayley-Hamilton, Z^2 = tr(Z) Z - det(Z).

    Every power of Z = h A, and so every truncated series, is a + b Z with two scalars; a term of
    Horner's rule costs two multiplications.  For a linear motor the scalars do not depend on the
    state, so the processor computes them while it waits for the state of the previous step.
    """
    (z, phi1, phi2, phi3), (f, drift, missed) = prepared, vectors
    moved = phi1[0] * f + phi1[1] * ca.mtimes(z, f)
    moved = moved + phi2[0] * drift + phi2[1] * ca.mtimes(z, drift)
    return moved, phi3[0] * missed + phi3[1] * ca.mtimes(z, missed)


def _by_functions(
    prepared: Sequence[Expression], vectors: _Vectors
) -> tuple[Expression, Expression]:
    """Increment and correction over h from the matrix functions phi1 to phi3."""
    (phi1, phi2, phi3), (f, drift, missed) = prepared, vectors
    return ca.mtimes(phi1, f) + ca.mtimes(phi2, drift), ca.mtimes(phi3, missed)


_Pair = tuple[Expression, Expression]
"""Scalars a, b of a + b Z."""


def _pairs(
    jacobian: Expression, interval: Expression, plan: StepPlan
) -> tuple[Expression, _Pair, _Pair, _Pair, _Pair]:
    """Z = h A / 2^squarings, and phi0 to phi3 of h A, each as scalars a, b of a + b Z."""
    z = jacobian * (interval / 2.0**plan.squarings)
    trace, determinant = z[0, 0] + z[1, 1], z[0, 0] * z[1, 1] - z[0, 1] * z[1, 0]

    def product(x: _Pair, y: _Pair) -> _Pair:
        both = x[1] * y[1]
        return (x[0] * y[0] - both * determinant, x[0] * y[1] + x[1] * y[0] + both * trace)

    def through(constant: float, x: _Pair) -> _Pair:
        """The scalars of constant + Z x."""
        return (constant - x[1] * determinant, x[0] + x[1] * trace)

    phi3 = (ca.SX(1 / math.factorial(plan.terms + 1)), ca.SX(0))
    for k in range(plan.terms, 2, -1):
        phi3 = through(1 / math.factorial(k), phi3)
    phi2 = through(0.5, phi3)
    phi1 = through(1.0, phi2)
    phi0 = through(1.0, phi1)
    for _ in range(plan.squarings):
        by = [product(phi0, phi) for phi in (phi1, phi2, phi3)]
        phi3 = tuple((by[2][j] + phi1[j] / 2 + phi2[j] + phi3[j]) / 8 for j in range(2))
        phi2 = tuple((by[1][j] + phi1[j] + phi2[j]) / 4 for j in range(2))
        phi1 = tuple((by[0][j] + phi1[j]) / 2 for j in range(2))
        phi0 = product(phi0, phi0)
    return z, phi0, phi1, phi2, phi3


def transition_functions(model: MotorModel, plan: StepPlan) -> tuple[ca.Function, ca.Function]:
    """Step of the nominal model split into two functions, for an interpolated loop.

        x(t + h) = phi0(hA) x + h phi1(hA) g v + h phi2(hA) g (v(t + h) - v),    g = df/dv

    The first function (nothing, inputs, parameter) -> (nothing, transition) computes the
    matrices, which vary slowly with the temperature.  The second function (state, inputs,
    transition) -> (state at the next sample, readings at this one) applies them at each sample.
    """
    x, u, p = model.symbols()
    now, _ = _inputs_within(model.held)(u)
    rates = model.rates(x, u, p)
    column = INPUTS.index("voltage")
    derivatives = [ca.jacobian(rates, x), ca.jacobian(rates, u)[:, column]]
    linear = ca.Function("linear", [x, u, p], derivatives)
    jacobian, gain = linear(ca.DM.zeros(2), now, p)
    z, phi0, phi1, phi2, _ = _pairs(jacobian, u[0], plan)
    one, pushed = ca.SX.eye(2), ca.mtimes(z, gain)
    parts = [ca.vec(phi0[0] * one + phi0[1] * z), u[0] * (phi1[0] * gain + phi1[1] * pushed)]
    if model.held == "foh":
        parts.append(u[0] * (phi2[0] * gain + phi2[1] * pushed))
    prepared = ca.vertcat(*parts)
    prepare = ca.Function("prepare", [ca.SX(0, 1), u, p], [ca.SX(0, 1), prepared])

    q = ca.SX.sym("q", prepared.numel())
    voltage = u[INPUTS.index("voltage_next") if model.held == "late" else column]
    following = ca.mtimes(ca.reshape(q[:4], 2, 2), x) + q[4:6] * voltage
    if model.held == "foh":
        following = following + q[6:8] * (u[INPUTS.index("voltage_next")] - voltage)
    return prepare, ca.Function("step", [x, u, q], [following, x])


def _squared(
    matrix: Expression, interval: Expression, plan: StepPlan
) -> tuple[Expression, Expression, Expression]:
    """The matrix functions phi1 to phi3 by scaling and squaring."""
    one = ca.SX.eye(matrix.shape[0])
    z = matrix * (interval / 2.0**plan.squarings)
    phi3 = one / math.factorial(plan.terms + 3)
    for k in range(plan.terms + 2, 2, -1):
        phi3 = ca.mtimes(z, phi3) + one / math.factorial(k)
    phi2 = ca.mtimes(z, phi3) + one / 2
    phi1 = ca.mtimes(z, phi2) + one
    phi0 = ca.mtimes(z, phi1) + one
    for k in range(plan.squarings):
        phi3 = (ca.mtimes(phi0, phi3) + phi1 / 2 + phi2 + phi3) / 8
        phi2 = (ca.mtimes(phi0, phi2) + phi1 + phi2) / 4
        phi1 = ca.mtimes(phi0 + one, phi1) / 2
        if k < plan.squarings - 1:
            phi0 = ca.mtimes(phi0, phi0)
    return phi1, phi2, phi3
