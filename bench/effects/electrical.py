"""Brush voltage drop and magnetic saturation, which depend on the current."""

from __future__ import annotations

import math

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["ELECTRICAL"]


def _brush(law_code: int, knee: float, uneven: float = 0.0) -> Law:
    """Brush voltage drop with the sign of the current; `knee` is relative to rated current."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        voltage = size * setup.motor.rated_voltage
        setup.plant["brush"] = voltage
        setup.plant["brush_knee"] = knee * setup.motor.rated_current
        setup.plant["brush_law"] = float(law_code)
        setup.plant["brush_uneven"] = uneven * setup.sign
        return {
            "voltage": voltage,
            "knee_current": knee * setup.motor.rated_current,
            "uneven": float(setup.plant["brush_uneven"]),
        }

    return law


def _saturation(prefix: str, power: float, exponential: bool, floor: float = 0.0) -> Law:
    """Saturation factor 1/(1 + k x^n) or exp(-k x^n), with x = |i| / rated current.

    With a floor, the factor tends to that value instead of 0, because the leakage flux
    does not saturate.
    """

    def law(setup: Setup, size: float) -> dict[str, float]:
        lost = min(size, 0.9) / (1.0 - floor)
        k = -math.log(1.0 - lost) if exponential else lost / (1.0 - lost)
        setup.plant[prefix] = k
        setup.plant[f"{prefix}_power"] = power
        setup.plant[f"{prefix}_exponential"] = float(exponential)
        if floor > 0.0:
            setup.plant[f"{prefix}_floor"] = floor
        return {"k": k, "power": power, "floor": floor, "lost_at_rated_current": min(size, 0.9)}

    return law


def _laws(prefix: str, floor: float = 0.0) -> dict[str, Law]:
    return {
        "rational": _saturation(prefix, 2.0, False),
        "exponential": _saturation(prefix, 2.0, True, floor),
        "early": _saturation(prefix, 1.3, False),
        "late": _saturation(prefix, 3.0, False),
    }


ELECTRICAL = (
    BenchEffect(
        "brush_drop", "electrical", ("current",), "rated voltage", (0.01, 0.1),
        {
            "knee": _brush(0, 0.03),
            "wide": _brush(0, 0.15),
            "exponential": _brush(1, 0.06),
            "rational": _brush(2, 0.05),
            "uneven": _brush(0, 0.03, 0.2),
        },
    ),
    BenchEffect(
        "flux_saturation", "electrical", ("current",), "all of Kt lost at rated current",
        (0.005, 0.06), _laws("flux"),
    ),
    BenchEffect(
        "inductance_saturation", "electrical", ("current",), "all of L lost at rated current",
        (0.05, 0.35), _laws("inductance", floor=0.15),
    ),
)  # fmt: skip
