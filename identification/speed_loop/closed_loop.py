"""State equations and simulation of the closed speed loop around the motor with its effects.

    v = x_1 + dr r - d w - k dw/dt,     dx_i/dt = x_(i+1) - a_i x_1 + br_i r - b_i w

realise the transfer function of the controller in observer canonical form, where x_(n+1) = 0.  The
reference r replaces the logged voltage among the inputs, and the shaft angle is a state if an
effect depends on it.  The loop is simulated by the same integration step as the fit, which is
exact for a linear motor.

The loop contains only effects that act on the motor at the given temperature.  It omits sensor
effects, which concern only the log; thermal effects that determine a temperature, because winding
and magnet are at the given one; and effects that depend on the time or index of a run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import INPUTS, MotorModel
from identification.model.scan import scan_of
from identification.model.step import advance
from identification.model.step_plan import plan_for, spectral_radius
from identification.model.term import AbstractTemperature, AbstractTerm, Expression
from identification.speed_loop.controller import PID, AbstractController

__all__ = [
    "ClosedLoop", "LoopRun", "acting_terms", "fastest_rate", "loop_inputs", "simulated_loop",
]  # fmt: skip

_NO_RUN: Final = -1.0
_KICK_STEPS: Final = 50
_MARGIN: Final = 1.5
_REFERENCE: Final = INPUTS.index("voltage")


def acting_terms(model: MotorModel) -> tuple[AbstractTerm, ...]:
    """Effects of a model that act on the motor in a closed loop at a given temperature."""
    return tuple(
        term
        for term in model.terms
        if term.equation != "sensor"
        and not isinstance(term, AbstractTemperature)
        and not _belongs_to_a_run(term)
    )


def _belongs_to_a_run(term: AbstractTerm) -> bool:
    """True if the equations of the term depend on the time in a run or on the run's index."""
    alone = MotorModel((term,))
    x, u, p = alone.symbols()
    moments = ca.vertcat(u[INPUTS.index("time")], u[INPUTS.index("run")])
    return bool(ca.depends_on(alone.rates(x, u, p), moments))


@dataclass(frozen=True)
class ClosedLoop(MotorModel):
    """Motor and controller; the input ``voltage`` is the speed reference [rad/s]."""

    controller: AbstractController = PID("P:1", kp=1.0)

    @cached_property
    def motor(self) -> MotorModel:
        """Motor without the controller."""
        return MotorModel(self.terms)

    @cached_property
    def turns(self) -> bool:
        """True if an effect depends on the shaft angle."""
        return any("position" in term.drivers for term in self.terms)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """States of the motor and of the controller, and the shaft angle if an effect needs it."""
        own = tuple(f"controller_{k}" for k in range(self._realisation.poles.size))
        return (*self.motor.state_names, *own, *(("angle",) if self.turns else ()))

    @cached_property
    def _realisation(self) -> _Realisation:
        return _Realisation.of(self.controller)

    @property
    def kick(self) -> float:
        """Voltage impulse of the controller for a reference step of 1 rad/s [V s^2/rad]."""
        return self._realisation.kick

    def rates(
        self,
        state: Expression,
        inputs: Expression,
        parameter: Expression,
        *,
        is_averaged: bool = False,  # noqa: ARG002  the angle is a state, so no input has its change
    ) -> Expression:
        """Right-hand side (n_state,) of motor, controller and shaft angle."""
        own, driven = self._driven(state, inputs, parameter)
        rates = [self.motor.rates(own, driven, parameter)]
        form, first = self._realisation, len(self.motor.state_names)
        for k in range(form.poles.size):
            following = state[first + k + 1] if k + 1 < form.poles.size else 0.0
            rates.append(
                following
                - form.poles[k] * state[first]
                + (form.reference[k] * inputs[_REFERENCE] - form.speed[k] * own[1])
            )
        if self.turns:
            rates.append(own[1])
        return ca.vertcat(*rates)

    def command(self, state: Expression, inputs: Expression, parameter: Expression) -> Expression:
        """Output voltage of the controller [V]."""
        return self._driven(state, inputs, parameter)[1][_REFERENCE]

    def _driven(
        self, state: Expression, inputs: Expression, parameter: Expression
    ) -> tuple[Expression, Expression]:
        """State of the motor, and the inputs with the controller's voltage and the shaft angle."""
        form, count = self._realisation, len(self.motor.state_names)
        own = state[:count]
        rows = [inputs[k] for k in range(len(INPUTS))]
        if self.turns:
            rows[INPUTS.index("angle")] = state[len(self.state_names) - 1]
        voltage = form.direct_reference * inputs[_REFERENCE] - form.direct_speed * own[1]
        if form.poles.size:
            voltage += state[count]
        rows[_REFERENCE] = voltage
        if form.derivative:
            # No algebraic loop: the acceleration depends on the current, not on the voltage.
            acceleration = self.motor.rates(own, ca.vertcat(*rows), parameter)[1]
            rows[_REFERENCE] = voltage - form.derivative * acceleration
        return own, ca.vertcat(*rows)


@dataclass(frozen=True)
class _Realisation:
    """Observer canonical form of a controller of order n."""

    poles: Array
    """a_1 to a_n, the monic denominator after s^n, (n,)."""
    speed: Array
    """b_1 to b_n, (n,)."""
    reference: Array
    """br_1 to br_n, (n,)."""
    direct_speed: float
    """d [V s/rad]."""
    direct_reference: float
    """dr [V s/rad]."""
    derivative: float
    """k [V s^2/rad]."""
    kick: float
    """Factor of the derivative of the reference [V s^2/rad]."""

    @classmethod
    def of(cls, controller: AbstractController) -> _Realisation:
        """Realisation by polynomial division of numerator by denominator."""
        speed, reference, monic = controller.transfer_function().padded()
        quotients = []
        for row in (speed, reference):
            # Remove k s, then d: what is left is strictly proper.
            for first in (0, 1):
                row[first + 1 : first + monic.size] -= row[first] * monic[1:]
            quotients.append((float(row[0]), float(row[1])))
        (derivative, direct), (kick, direct_reference) = quotients
        return cls(monic[1:], speed[2:], reference[2:], direct, direct_reference, derivative, kick)


@dataclass(frozen=True)
class LoopRun:
    """Simulated step responses of a closed loop at one temperature."""

    time: Array
    """(n_time,) uniform, from 0 [s]."""
    speed: Array
    """(n_time, n_draw) [rad/s]."""
    acceleration: Array
    """(n_time, n_draw) [rad/s^2]."""
    current: Array
    """(n_time, n_draw) [A]."""
    voltage: Array
    """(n_time, n_draw), without the impulse of the derivative at 0 [V]."""


def simulated_loop(
    loop: ClosedLoop,
    parameters: Array,
    own_states: Array,
    step: float,
    conditions: list[tuple[float, float]],
    time: Array,
) -> list[LoopRun]:
    """Responses to a step of the reference, from standstill and zero current.

    The parameters are physical, (n_parameter, n_draw), the states of the effects start at
    (n_motor_state - 2,), the step is in rad/s, the time (n_time,) uniform from 0 [s].  Each
    condition is the temperature of winding and magnet, and the highest temperature that the motor
    has had before [degC].
    """
    lanes = parameters.shape[1]
    rows, starts = [], []
    for temperature, peak in conditions:
        row = loop_inputs(time[1], step, temperature, peak)
        rows.append(np.repeat(row[None, :], time.size, axis=0))
        start = np.zeros((len(loop.state_names), lanes))
        start[2 : 2 + own_states.size] = own_states[:, None]
        starts.append(_kicked(loop, start, row, parameters, step))
    x, u, p = loop.symbols()
    rate = fastest_rate(loop, starts, rows, parameters) * time[1]
    plan = plan_for(_MARGIN * rate, linear=not loop.terms)
    rates = loop.rates(x, u, p)
    seen = ca.vertcat(x[1], rates[1], x[0], loop.command(x, u, p))
    advanced = ca.Function("loop", [x, u, p], [advance(loop, plan, x, u, p), seen])
    _, outputs = scan_of(advanced)(rows, parameters, starts)
    return [LoopRun(time, *(y[:, k, :] for k in range(4))) for y in outputs]


def loop_inputs(interval: float, reference: float, temperature: float, peak: float) -> Array:
    """Inputs (n_input,) of a loop with a constant reference [rad/s] in place of the voltage.

    `peak` is the highest temperature that the motor has had before [degC].
    """
    known = {
        "interval": interval,
        "voltage": reference,
        "voltage_next": reference,
        "temperature": temperature,
        "temperature_next": temperature,
        "run": _NO_RUN,
        "peak_temperature": max(peak, temperature),
    }
    return np.array([known.get(name, 0.0) for name in INPUTS])


def _kicked(loop: ClosedLoop, start: Array, row: Array, parameters: Array, step: float) -> Array:
    """State just after the step, including the impulse k r of the derivative [V s].

    The impulse acts on the inductance alone.  The midpoint rule integrates the current from zero,
    because the inductance may depend on the current.
    """
    kick = loop.kick * step
    if not kick:
        return start
    x, u, p = loop.motor.symbols()
    inverse = ca.jacobian(loop.motor.rates(x, u, p)[0], u[_REFERENCE])
    slope = ca.Function("inverse_inductance", [x, u, p], [inverse])
    inputs = np.repeat(row[:, None], parameters.shape[1], axis=1)
    state, count = start.copy(), x.numel()
    for _ in range(_KICK_STEPS):
        half = state[:count].copy()
        half[0] += 0.5 * kick / _KICK_STEPS * np.asarray(slope(half, inputs, parameters))[0]
        state[0] += kick / _KICK_STEPS * np.asarray(slope(half, inputs, parameters))[0]
    return state


def fastest_rate(
    model: MotorModel, starts: list[Array], rows: list[Array], parameters: Array
) -> float:
    """Largest spectral radius of the Jacobian, at standstill and at the reference speed [1/s].

    Each simulation has its states at standstill (n_state, n_draw) and inputs (n_time, n_input); the
    input ``voltage`` of the first row is taken as the speed.  The parameters are physical,
    (n_parameter, n_draw).
    """
    values, found = np.tile(parameters.T, (2, 1)), [0.0]
    for start, row in zip(starts, rows, strict=True):
        moving = start.copy()
        moving[1] = row[0, _REFERENCE]
        inputs = np.tile(row[0], (len(values), 1))
        found.append(spectral_radius(model, np.hstack([start, moving]).T, inputs, values))
    return max(found)
