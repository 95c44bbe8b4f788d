"""Simulation of the sampled speed loop: motor with effects, digital controller, limited drive.

Every sample time the controller computes from the measured speed w and the reference r

    e = r - w
    I = I + ki Ts (e + e_before) / 2                  trapezoidal rule
    u = kp e + I + kff r - kd (w - w_before) / Ts     derivative of the speed, not of the error

The voltage u, limited to that of the drive, acts after the delay and is held for one sample time.
The drive limits the current as an ideal chopper does: it lowers the voltage to the value that
leads the current to its limit, from the motor's own electrical equation.

Anti-windup is conditional integration: the integral keeps its value while the voltage or the
current is at its limit and the error would drive it further.

The motor is integrated by the step of the fit, which is exact for a linear motor.

Source: Astrom and Hagglund, Advanced PID Control, ISA 2006, sections 3.5 (conditional integration)
and 13 (discretisation); Astrom and Wittenmark, Computer-Controlled Systems, 1997, chapter 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import INPUTS, MotorModel
from identification.model.scan import scan_of
from identification.model.step import advance
from identification.model.step_plan import StepPlan, plan_for
from identification.speed_loop.closed_loop import LoopRun, fastest_rate, loop_inputs
from identification.tuning.motor import UncertainMotor
from identification.tuning.specification import Specification

__all__ = ["GAINS", "Drive", "Response", "most_samples"]

GAINS: Final = ("kp", "ki", "kd", "kff")
"""Gains of the controller: [V s/rad], [V/rad], [V s^2/rad], [V s/rad]."""

_LIMITS: Final = ("voltage_limit", "current_limit", "anti_windup")
_TIMING: Final = ("samples", "applies", "reference", "sample_time")
_CONTROL: Final = ("integral", "error", "speed", "applied", "is_limited")
_INDEX: Final = {name: k for k, name in enumerate(INPUTS)}
_UNLIMITED: Final = 1e12
_MARGIN: Final = 1.5
_MOST_SUBSTEPS: Final = 20
_DELAY_ERROR: Final = 0.01
_MOST_STEPS: Final = 10_000


@dataclass(frozen=True)
class Response(LoopRun):
    """Simulated responses at one temperature; the voltage is that at the motor."""

    limited: Array
    """(n_time, n_draw) 1 where voltage or current is at its limit [-]."""


class Drive:
    """Drive that simulates responses of each draw to a step of the reference from standstill."""

    def __init__(
        self, motor: UncertainMotor, specification: Specification, *, anti_windup: bool = True
    ) -> None:
        self.motor, self.specification = motor, specification
        self.substeps, apply = _substeps(specification)
        self.step = specification.sample_time / self.substeps
        self._wait, self._apply = divmod(apply, self.substeps)
        limits = (specification.voltage, specification.current)
        self._limits = [min(limit, _UNLIMITED) for limit in limits] + [float(anti_windup)]

    def responses(
        self, gains: Array, reference: float, temperatures: list[float], samples: int
    ) -> list[Response]:
        """Step responses [rad/s] of every draw, one for each temperature [degC].

        The gains are (4,), or (4, n_draw), in the order of `GAINS`.
        """
        lanes = self.motor.count
        columns = np.broadcast_to(np.reshape(gains, (len(GAINS), -1)), (len(GAINS), lanes))
        limits = np.repeat(np.array(self._limits)[:, None], lanes, axis=1)
        parameters = np.concatenate([self.motor.values, columns, limits])
        rows = [self._rows(t, reference, samples) for t in temperatures]
        model = self.motor.model
        own = [np.zeros((len(model.state_names), lanes)) for _ in temperatures]
        rate = fastest_rate(model, own, [r[:, : len(INPUTS)] for r in rows], self.motor.values)
        plan = plan_for(_MARGIN * rate * self.step, linear=not model.terms)
        step = _step(model, plan, self._wait)
        starts = [np.zeros((step.size1_in(0), lanes)) for _ in temperatures]
        _, outputs = scan_of(step)(rows, parameters, starts)
        time: Array = self.step * np.arange(rows[0].shape[0], dtype=np.float64)
        return [Response(time, *np.moveaxis(y, 1, 0)) for y in outputs]

    def _rows(self, temperature: float, reference: float, samples: int) -> Array:
        """Inputs of each substep, (n_step, n_input)."""
        count = samples * self.substeps
        rows = np.zeros((count, len(INPUTS) + len(_TIMING)))
        # The reference is a scale of the speed for `fastest_rate`; the controller replaces it.
        inputs = loop_inputs(self.step, reference, temperature, self.motor.peak)
        rows[:, : len(INPUTS)] = inputs
        index = np.arange(count) % self.substeps
        for k, column in enumerate(
            (index == 0, index == self._apply, reference, self.specification.sample_time)
        ):
            rows[:, len(INPUTS) + k] = column
        return rows


def most_samples(specification: Specification) -> int:
    """Largest number of sample times that one response may have."""
    return _MOST_STEPS // _substeps(specification)[0]


def _substeps(specification: Specification) -> tuple[int, int]:
    """Substeps of a sample time, and the delay in substeps, rounded to 1 % of a sample time."""
    delay = specification.delay / specification.sample_time
    errors = [abs(round(n * delay) / n - delay) for n in range(1, _MOST_SUBSTEPS + 1)]
    count = 1 + next(
        (k for k, error in enumerate(errors) if error <= _DELAY_ERROR), int(np.argmin(errors))
    )
    return count, round(count * delay)


@lru_cache(32)
def _step(model: MotorModel, plan: StepPlan, wait: int) -> ca.Function:
    """SX function (carry, inputs, parameter) -> (carry after a substep, outputs at its start).

    The carry is the state of the motor, the shaft angle, the memory of the controller and the
    voltages that wait for their application.
    """
    n, own = len(model.state_names), len(model.parameters)
    carry = ca.SX.sym("carry", n + 1 + len(_CONTROL) + wait + 1)
    inputs = ca.SX.sym("inputs", len(INPUTS) + len(_TIMING))
    parameter = ca.SX.sym("parameter", own + len(GAINS) + len(_LIMITS))
    state, angle, motor_values = carry[:n], carry[n], parameter[:own]
    samples, applies = inputs[len(INPUTS)], inputs[len(INPUTS) + 1]
    highest, largest = parameter[own + len(GAINS)], parameter[own + len(GAINS) + 1]
    memory = [carry[n + 1 + k] for k in range(len(_CONTROL))]
    queue = [carry[n + 1 + len(_CONTROL) + k] for k in range(wait + 1)]

    gains = [parameter[own + k] for k in range(len(GAINS))]
    anti_windup = parameter[own + len(GAINS) + 2]
    command, integral = _controller(state, inputs, gains, memory, (highest, anti_windup))
    limited = ca.fmax(-highest, ca.fmin(highest, command))
    waiting = zip([limited, *queue[:-1]], queue, strict=True)
    queue = [ca.if_else(samples, new, old) for new, old in waiting]
    applied = ca.if_else(applies, queue[-1], memory[3])
    rows = [inputs[k] for k in range(len(INPUTS))]
    rows[_INDEX["angle"]] = angle
    rows[_INDEX["turn"]] = rows[0] * state[1]
    rows[_INDEX["angle_next"]] = angle + rows[_INDEX["turn"]]
    voltage = _chopped(model, state, (rows, applied), motor_values, (highest, largest))
    rows[_INDEX["voltage"]] = rows[_INDEX["voltage_next"]] = voltage
    driven = ca.vertcat(*rows)
    after = advance(model, plan, state, driven, motor_values)
    at_limit = ca.fmax(
        ca.fabs(command) > highest, ca.fabs(voltage - applied) > 1e-9 * (1 + ca.fabs(applied))
    )
    error = inputs[len(INPUTS) + 2] - state[1]
    control = [
        ca.if_else(samples, integral, memory[0]),
        ca.if_else(samples, error, memory[1]),
        ca.if_else(samples, state[1], memory[2]),
        applied,
        ca.if_else(samples, at_limit, ca.fmax(memory[4], at_limit)),
    ]
    turned = angle + 0.5 * rows[0] * (state[1] + after[1])
    following = ca.vertcat(after, turned, *control, *queue)
    acceleration = model.rates(state, driven, motor_values)[1]
    seen = ca.vertcat(state[1], acceleration, state[0], voltage, at_limit)
    return ca.Function("drive", [carry, inputs, parameter], [following, seen])


def _controller(
    state: ca.SX, inputs: ca.SX, gains: list[ca.SX], memory: list[ca.SX], limit: tuple[ca.SX, ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Output voltage of the controller before its limit, and its new integral [V]."""
    kp, ki, kd, kff = gains
    before, error_before, speed_before, _, is_limited = memory
    reference, sample_time = inputs[len(INPUTS) + 2], inputs[len(INPUTS) + 3]
    highest, anti_windup = limit
    error = reference - state[1]
    direct = kp * error + kff * reference - kd * (state[1] - speed_before) / sample_time
    integral = before + 0.5 * sample_time * ki * (error + error_before)
    command = direct + integral
    winds = ca.fmax(
        ca.logic_and(ca.fabs(command) > highest, ki * error * command > 0),
        ca.logic_and(is_limited, ki * error * state[0] > 0),
    )
    kept = ca.if_else(ca.logic_and(winds, anti_windup), before, integral)
    return direct + kept, kept


def _chopped(
    model: MotorModel,
    state: ca.SX,
    drive: tuple[list[ca.SX], ca.SX],
    parameter: ca.SX,
    limits: tuple[ca.SX, ca.SX],
) -> ca.SX:
    """Applied voltage, lowered so that the current does not pass its limit in this substep [V].

    The electrical equation, linearised about the present state, gives the current after the
    substep h as i + (1 - exp(-a h)) / a di/dt, with a = R/L; di/dt is affine in the voltage.
    """
    rows, applied = drive
    highest, largest = limits
    x, u, p = model.symbols()
    rate = model.rates(x, u, p)[0]
    parts = [rate, ca.jacobian(rate, u[_INDEX["voltage"]]), -ca.jacobian(rate, x[0])]
    linear = ca.Function("electrical", [x, u, p], parts)
    rows = list(rows)
    rows[_INDEX["voltage"]] = rows[_INDEX["voltage_next"]] = applied
    slope, inverse, damping = linear(state, ca.vertcat(*rows), parameter)
    decay = damping * rows[0]
    small = ca.fabs(decay) < 1e-4
    quotient = (1 - ca.exp(-decay)) / ca.if_else(small, 1, decay)
    reach = rows[0] * ca.if_else(small, 1 - decay / 2 + decay**2 / 6, quotient)
    low, high = (
        applied + ((limit - state[0]) / reach - slope) / inverse for limit in (-largest, largest)
    )
    return ca.fmax(-highest, ca.fmin(highest, ca.fmax(low, ca.fmin(high, applied))))
