"""Sampling interval against the time constants of the motor.

The two balances at 25 degC have the poles s of

    s^2 + (Ra/L + b/J) s + (Kt^2 + Ra b)/(L J) = 0

A transient is resolved if the sampling interval is at most its time constant 1/abs(s): in a longer
one, more than 63 % of it pass unseen.  A complex pair counts as one transient of both balances.

Source: Ljung, System Identification, 2nd edition (1999), section 13.7 (choice of the sampling
interval), where ten samples in the period of the bandwidth, 1.6 in a time constant, are the rule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

__all__ = ["passed_unseen", "rounded_up", "sampling_advice", "sampling_note"]

_WANTED: Final = {"L": 5.0, "J": 20.0}
"""Advised number of samples in the time constant that determines the parameter."""
_NAMES: Final = {"L": "electrical", "J": "mechanical"}


def sampling_advice(values: Mapping[str, float], interval: float) -> dict[str, str]:
    """Sampling rate to record at, for each parameter whose transient is not resolved.

    That is L where the electrical transient is shorter than the interval [s], and all parameters
    without a temperature where the mechanical one is, too.
    """
    passed = _unresolved(values, interval)
    rates = {name: _WANTED[name] / time for name, time in passed.items()}
    advice = {
        name: f"sample at {rounded_up(rate)} Hz or faster (now {1.0 / interval:.4g} Hz)"
        for name, rate in rates.items()
    }
    if len(advice) < len(_NAMES):
        return advice
    return dict.fromkeys(("Ra25", "Kt25", "J", "b", "L"), advice[max(rates, key=rates.__getitem__)])


def passed_unseen(values: Mapping[str, float], interval: float) -> frozenset[str]:
    """Parameters that cannot be identified at this rate, as the mechanical transient passes unseen.

    An electrical transient alone leaves its trace in the speed, from which a fit determines L.
    Where the mechanical one passes within an interval, too, J and L follow from the instants of
    the voltage steps alone: a step between two samples changes them by orders of magnitude.
    """
    passed = _unresolved(values, interval)
    return frozenset(passed) if "J" in passed else frozenset()


def sampling_note(values: Mapping[str, float], interval: float) -> str:
    """Remark on transients that are shorter than the interval [s]; empty if there are none."""
    passed = _unresolved(values, interval)
    if not passed:
        return ""
    advice = sampling_advice(values, interval)
    now = _milliseconds(interval)
    if len(passed) == len(_NAMES):
        return (
            f"the sampling interval of {now} is too long for this motor: it resolves neither the "
            "electrical nor the mechanical transient, and the estimates rest on the exact "
            f"instants of the voltage steps; J and L cannot be identified; {advice['J']}"
        )
    name, time = next(iter(passed.items()))
    return (
        f"the sampling interval of {now} does not resolve the {_NAMES[name]} time constant of "
        f"{_milliseconds(time)}, and the estimate of {name} rests on the exact instants of the "
        f"voltage steps; {advice[name]}"
    )


def rounded_up(value: float) -> str:
    """Two significant digits of a positive number, rounded up."""
    step = 10.0 ** (math.floor(math.log10(max(value, 1e-300))) - 1)
    return f"{math.ceil(value / step - 1e-9) * step:.6g}"


def _unresolved(values: Mapping[str, float], interval: float) -> dict[str, float]:
    """Time constants below the sampling interval [s], by the parameter that each determines."""
    ra, kt, inertia, friction, inductance = (values[n] for n in ("Ra25", "Kt25", "J", "b", "L"))
    if not (ra > 0.0 and inertia > 0.0 and inductance > 0.0):
        return {}
    sum_of_poles = ra / inductance + friction / inertia
    product = (kt**2 + ra * friction) / (inductance * inertia)
    slow, fast = sorted(np.abs(np.roots([1.0, sum_of_poles, product])).tolist())
    is_electrical_faster = inductance / ra < inertia * ra / (kt**2 + ra * friction)
    of_fast, of_slow = ("L", "J") if is_electrical_faster else ("J", "L")
    return {name: 1.0 / s for name, s in ((of_fast, fast), (of_slow, slow)) if interval * s > 1.0}


def _milliseconds(time: float) -> str:
    return f"{1e3 * time:.3g} ms"
