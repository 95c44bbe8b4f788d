"""Magnitude optimum tuning of a PI controller for the identified motor and its sample interval.

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

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from identification.quantities import REFERENCE_TEMPERATURE_DEGC
from identification.speed_loop.controller import PID
from identification.speed_loop.loop import motor_draws, plant

__all__ = ["suited_controller"]

_DELAY: Final = 1.5
"""Delay of a digital controller [sample intervals]."""


def suited_controller(draws: Mapping[str, ArrayLike], interval: float) -> PID | None:
    """PI controller by the magnitude optimum at 25 degC, with gains of three digits.

    The rule uses the medians of the draws and the sample interval of the controller [s].  None if
    it gives no positive gains, as for a motor that oscillates without a controller.
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
