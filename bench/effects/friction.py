"""Friction beyond viscous friction: Coulomb, Stribeck, drag, and temperature dependence."""

from __future__ import annotations

import math

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["FRICTION"]


def _coulomb(setup: Setup, size: float) -> dict[str, float]:
    """Coulomb friction T_c sign(w), set-valued at standstill."""
    torque = size * setup.motor.rated_torque
    setup.plant["coulomb_forward"] += torque
    setup.plant["coulomb_backward"] += torque
    return {"torque": torque}


def _coulomb_uneven(setup: Setup, size: float) -> dict[str, float]:
    """Coulomb friction 15 % above its mean in one direction and 15 % below in the other."""
    mean, tilt = size * setup.motor.rated_torque, 0.15 * setup.sign
    setup.plant["coulomb_forward"] += mean * (1.0 + tilt)
    setup.plant["coulomb_backward"] += mean * (1.0 - tilt)
    return {"torque": mean, "forward": mean * (1.0 + tilt), "backward": mean * (1.0 - tilt)}


def _coulomb_soft(setup: Setup, size: float) -> dict[str, float]:
    """Smooth Coulomb friction T_c tanh(w / w_0): seals that creep before they slide.

    The width w_0 is 1 % of rated speed.
    """
    torque, width = size * setup.motor.rated_torque, 0.01 * setup.motor.rated_speed
    setup.plant["coulomb_smooth"] = torque
    setup.plant["coulomb_width"] = width
    return {"torque": torque, "width": width}


def _stribeck(power: float, lorentzian: bool) -> Law:
    """Stribeck friction that decays with speed, exponentially or as a Lorentzian."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        torque = size * setup.motor.rated_torque
        speed = setup.rng.uniform(0.03, 0.12) * setup.motor.rated_speed
        setup.plant["stribeck"] = torque
        setup.plant["stribeck_speed"] = speed
        setup.plant["stribeck_power"] = power
        setup.plant["stribeck_lorentzian"] = float(lorentzian)
        return {"torque": torque, "speed": speed, "power": power}

    return law


def _drag(power: float) -> Law:
    """Drag torque T sign(w) |w / w_r|^n; T is its value at the rated speed w_r."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        torque = size * setup.motor.rated_torque
        setup.plant["drag"] = torque
        setup.plant["drag_power"] = power
        return {
            "torque_at_rated_speed": torque,
            "power": power,
            "coefficient": torque / setup.motor.rated_speed**power,
        }

    return law


def _viscous_linear(setup: Setup, size: float) -> dict[str, float]:
    """Viscous friction b (1 + beta (T - 25)): the grease becomes thinner."""
    beta = -min(size, 0.9) / 100.0
    setup.plant["viscous_linear"] = beta
    return {"beta": beta}


def _viscous_exponential(setup: Setup, size: float) -> dict[str, float]:
    """Viscous friction b exp(beta (T - 25))."""
    beta = math.log(1.0 - min(size, 0.95)) / 100.0
    setup.plant["viscous_exponential"] = beta
    return {"beta": beta}


FRICTION = (
    BenchEffect(
        "coulomb_friction", "mechanical", ("speed",), "rated torque", (0.01, 0.15),
        {"sign": _coulomb, "uneven": _coulomb_uneven, "soft": _coulomb_soft},
    ),
    BenchEffect(
        "stribeck_friction", "mechanical", ("speed",), "rated torque", (0.02, 0.15),
        {
            "gaussian": _stribeck(2.0, False),
            "exponential": _stribeck(1.0, False),
            "lorentzian": _stribeck(2.0, True),
        },
    ),
    BenchEffect(
        "quadratic_drag", "mechanical", ("speed",), "rated torque at rated speed", (0.02, 0.3),
        {"square": _drag(2.0), "power_1.7": _drag(1.7), "power_2.3": _drag(2.3)},
    ),
    BenchEffect(
        "viscous_temperature", "mechanical", ("speed", "temperature"),
        "all of b lost over 100 K", (0.2, 0.7),
        {"linear": _viscous_linear, "exponential": _viscous_exponential},
    ),
)  # fmt: skip
