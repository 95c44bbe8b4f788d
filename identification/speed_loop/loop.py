"""Linear speed loop as transfer functions, one for each posterior draw and temperature.

    reference -->(+)--> C(s) --v--> Kt / ((L s + Ra)(J s + b) + Kt^2) --w--+-->
                  ^-                                                       |
                  +--------------------------------------------------------+

`plant` is equation 10 of the source (its equations 13 and 14 at 25 and 125 degC).  `close` returns
the loop under feedback of the speed (equations 15 and 16 for unity feedback and gain 1).  All
polynomials are arrays over loops, so a thousand draws cost little more than one.

Source: Sidahmed and Mahmoud, Int. J. Advance Research in Computer Science and Management
Studies 2(9), 2014, pages 384-388, equations 7 to 16.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.errors import OptionError
from identification.model.declared import coefficient_at
from identification.quantities import DECLARED_PARAMETERS, REFERENCE_TEMPERATURE_DEGC
from identification.speed_loop.controller import PID, AbstractController

__all__ = ["Loop", "close", "motor_draws", "plant", "suited_controller"]

# Zero inductance would lower the order of the loop by one and, with a derivative gain, make it not
# strictly proper.  This ratio of electrical to mechanical time constant changes no reported digit.
_LEAST_ELECTRICAL_SHARE: Final = 1e-9
_SLOPES: Final = ("alpha_Ra", "alpha_Kt")
_POSITIVE: Final = ("Ra25", "J")
_DELAY: Final = 1.5
"""Delay of a digital controller [sample intervals]."""


@dataclass(frozen=True)
class Loop:
    """Open loop L = N / D and closed loop Nr / (D + N), monic, in falling powers of s.

    The order n_pole is that of the controller plus 2.
    """

    numerator: Array
    """N, (n_loop, n_pole), from s^(n_pole - 1) down to s^0."""
    open_denominator: Array
    """D, (n_loop, n_pole + 1), first coefficient 1."""
    reference: Array | None = None
    """Nr, like `numerator`; None if the controller acts on the error, where it is N."""

    @property
    def closed_numerator(self) -> Array:
        """Nr, (n_loop, n_pole)."""
        return self.numerator if self.reference is None else self.reference

    @property
    def closed_denominator(self) -> Array:
        """D + N, (n_loop, n_pole + 1)."""
        closed = self.open_denominator.copy()
        closed[:, 1:] += self.numerator
        return closed

    @property
    def final_value(self) -> Array:
        """Final speed after a reference step of 1 rad/s, if the loop is stable (n_loop,) [rad/s].

        NaN if the closed loop has no finite DC gain.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            value = self.closed_numerator[:, -1] / self.closed_denominator[:, -1]
        return np.where(np.isfinite(value), value, np.nan)


def motor_draws(draws: Mapping[str, ArrayLike], temperatures: Sequence[float]) -> dict[str, Array]:
    """Draws (n_draw,) of the nominal parameters, validated and broadcast to one length.

    Other names are ignored.

    The temperature coefficients may be omitted if only 25 degC is requested, where they have no
    influence.

    Raises:
        OptionError: A parameter is missing, not finite, of another length, or has a physically
            impossible sign.
    """
    needed = dict(draws)
    if all(temperature == REFERENCE_TEMPERATURE_DEGC for temperature in temperatures):
        needed = {name: 0.0 for name in _SLOPES} | needed
    missing = [name for name in DECLARED_PARAMETERS if name not in needed]
    if missing:
        raise OptionError(
            f"no value for {', '.join(missing)}; expected {', '.join(DECLARED_PARAMETERS)} "
            f"(alpha_Ra and alpha_Kt are optional if the only temperature is 25 degC)"
        )
    values = {
        name: np.atleast_1d(np.asarray(needed[name], dtype=np.float64))
        for name in DECLARED_PARAMETERS
    }
    count = max(value.size for value in values.values())
    for name, value in values.items():
        _check(name, value, count)
    return {name: np.broadcast_to(value, (count,)) for name, value in values.items()}


def _check(name: str, value: Array, count: int) -> None:
    if value.ndim != 1 or value.size not in (1, count) or count == 0:
        raise OptionError(
            f"{name} has shape {value.shape}; expected one number or {count} draws", value=name
        )
    wrong = ~np.isfinite(value)
    if name in _POSITIVE:
        wrong |= value <= 0
    elif name not in _SLOPES:
        wrong |= value < 0
    if wrong.any():
        kind = {True: "above 0", False: "of at least 0"}[name in _POSITIVE]
        expected = "a finite number" if name in _SLOPES else f"a finite number {kind}"
        raise OptionError(
            f"{name} is {value[wrong][0]:g} {DECLARED_PARAMETERS[name].unit}; expected {expected}",
            value=float(value[wrong][0]),
        )


def plant(draws: Mapping[str, Array], temperature: float) -> tuple[Array, Array]:
    """Transfer function of the motor from voltage to speed at one temperature (equations 7 to 10).

        w/v = Kt / ((L s + Ra)(J s + b) + Kt^2) = gain / (s^2 + a1 s + a0)

    The draws are those of `motor_draws`, the temperature is that of winding and magnet [degC].  The
    gain is (n_draw,) [rad/(V s^3)], the monic denominator (n_draw, 3) in falling powers.
    """
    resistance = coefficient_at(draws["Ra25"], draws["alpha_Ra"], temperature)
    constant = coefficient_at(draws["Kt25"], draws["alpha_Kt"], temperature)
    inertia, friction = draws["J"], draws["b"]
    static = resistance * friction + constant**2
    with np.errstate(divide="ignore", invalid="ignore"):
        least = _LEAST_ELECTRICAL_SHARE * resistance**2 * inertia / static
    floor = np.nan_to_num(np.abs(least), nan=0.0, posinf=0.0)
    inductance = np.maximum(draws["L"], np.maximum(floor, np.finfo(float).tiny))
    product = inductance * inertia
    denominator = np.stack(
        [np.ones_like(product), resistance / inductance + friction / inertia, static / product],
        axis=-1,
    )
    return constant / product, denominator


def close(
    draws: Mapping[str, Array], temperatures: Sequence[float], controller: AbstractController
) -> Loop:
    """Speed loop under feedback of the speed, for all draws at all temperatures [degC].

    The draws are those of `motor_draws`, the loops in the order of the temperatures, n_loop =
    n_temperature * n_draw.
    """
    motors = [plant(draws, temperature) for temperature in temperatures]
    gain = np.concatenate([motor[0] for motor in motors])[:, None]
    motor = np.concatenate([motor[1] for motor in motors])
    numerator, reference, poles = controller.transfer_function().padded()
    denominator = np.zeros((motor.shape[0], poles.size + 2))
    for k, coefficient in enumerate(poles):
        denominator[:, k : k + 3] += coefficient * motor
    return Loop(gain * numerator, denominator, gain * reference)


def suited_controller(draws: Mapping[str, ArrayLike], interval: float) -> PID | None:
    """PI controller by the magnitude optimum at 25 degC, with gains of three digits.

    The rule uses the medians of the draws and the sample interval of the controller [s].  None if
    it gives no positive gains, as for a motor that oscillates without a controller.

    The amplitude of the closed loop stays at 1 up to the highest possible frequency.  For the plant

        G(s) = K exp(-s theta) / (1 + a1 s + a2 s^2),        exp(-s theta) = 1 / (1 + theta s)

    with the polynomial 1 + c1 s + c2 s^2 + c3 s^3 of motor and delay together, the rule gives

        A1 = c1,  A2 = c1 A1 - c2,  A3 = c1 A2 - c2 A1 + c3
        kp = A3 / (2 K (A1 A2 - A3)),      ki = A2 / (2 K (A1 A2 - A3))

    The delay of one and a half sample intervals is that of a digital controller: one interval of
    computation and half of one of the zero-order hold.  It bounds the gains of a motor with a small
    inductance.

    Source: Kessler, Regelungstechnik 3 (1955), 40-49 (magnitude optimum); Vrancic, Strmcnik and
    Juricic, Automatica 37 (2001), 1473-1479 (gains from the moments A1 to A3).
    """
    middle = {
        name: np.median(np.asarray(values, dtype=np.float64)) for name, values in draws.items()
    }
    temperature = REFERENCE_TEMPERATURE_DEGC
    gain, denominator = plant(motor_draws(middle, [temperature]), temperature)
    _, a1, a0 = denominator[0]
    static = float(gain[0] / a0)
    a1, a2 = a1 / a0, 1.0 / a0
    delay = _DELAY * interval
    c1, c2, c3 = a1 + delay, a2 + a1 * delay, a2 * delay
    first, second = c1, c1**2 - c2
    third = c1 * second - c2 * first + c3
    common = 2.0 * static * (first * second - third)
    if not (np.isfinite(common) and common > 0.0 and second > 0.0 and third > 0.0):
        return None
    kp, ki = (f"{value / common:.3g}" for value in (third, second))
    return PID(f"PI:{kp},{ki}", float(kp), float(ki))
