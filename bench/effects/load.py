"""Mechanical loads: load torque, cogging, changed inertia, elastic shaft."""

from __future__ import annotations

import math

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["LOAD"]

_ORDERS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 14, 16, 22, 24, 28)


def _load(setup: Setup, size: float) -> dict[str, float]:
    """Constant load torque."""
    torque = setup.sign * size * setup.motor.rated_torque
    setup.plant["load"] = torque
    return {"torque": torque}


def _load_wandering(setup: Setup, size: float) -> dict[str, float]:
    """Load torque that varies by 10 %, with a period of 0.7 run durations."""
    chosen = _load(setup, size)
    setup.plant["load_wander"] = 0.1
    setup.plant["load_period"] = 0.7 * setup.duration
    return {**chosen, "wander": 0.1}


def _load_step(edge: float) -> Law:
    """Load torque during one interval of one training run, with sharp or linear edges."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        number = setup.training_run()
        run = setup.runs[number]
        start = setup.rng.uniform(0.2, 0.5) * run.duration
        stop = start + setup.rng.uniform(0.2, 0.4) * run.duration
        torque = setup.sign * size * setup.motor.rated_torque
        run.overrides.update(
            step_torque=torque, step_start=start, step_stop=stop, step_edge=edge * run.duration
        )
        return {"run": float(number), "torque": torque, "start": start, "stop": stop}

    return law


def _cogging(shares: tuple[float, ...]) -> Law:
    """Cogging torque as harmonics of the shaft angle.

    The base order is limited such that at a fifth of rated speed the highest harmonic advances by
    at most 1.2 rad per sample; the bench could not record a faster ripple.
    """

    def law(setup: Setup, size: float) -> dict[str, float]:
        motor = setup.motor
        finest = 1.2 / (0.2 * motor.rated_speed * motor.sample_interval * len(shares))
        order = int(setup.rng.choice([o for o in _ORDERS if o <= max(finest, 1.0)]))
        chosen = {"order": float(order)}
        for k, share in enumerate(shares, start=1):
            torque = share * size * motor.rated_torque
            setup.plant[f"cogging_{k}"] = torque
            setup.plant[f"cogging_order_{k}"] = float(k * order)
            setup.plant[f"cogging_phase_{k}"] = setup.rng.uniform(0.0, 2.0 * math.pi)
            chosen[f"torque_{k}"] = torque
        return chosen

    return law


def _inertia(direction: float) -> Law:
    """Larger or smaller inertia in one training run."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        number = setup.training_run()
        inertia = setup.motor.J * (1.0 + direction * min(size, 0.9))
        setup.runs[number].overrides["J"] = inertia
        return {"run": float(number), "J": inertia, "ratio": inertia / setup.motor.J}

    return law


def _compliance(hardening: float) -> Law:
    """Elastic shaft in front of 30 to 60 % of the inertia; a larger size means a softer shaft."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        motor, share = setup.motor, setup.rng.uniform(0.3, 0.6)
        resonance = min(max(0.03 / size, 0.05), 1.2) / motor.sample_interval
        load = share * motor.J
        reduced = load * (1.0 - share)
        stiffness = reduced * resonance**2
        damping = 2.0 * setup.rng.uniform(0.03, 0.1) * resonance * reduced
        setup.plant["load_inertia"] = load
        setup.plant["shaft_stiffness"] = stiffness
        setup.plant["shaft_damping"] = damping
        setup.plant["shaft_cubic"] = hardening * stiffness**3 / motor.rated_torque**2
        return {
            "load_inertia": load, "stiffness": stiffness, "damping": damping,
            "resonance_rad_s": resonance, "cubic": float(setup.plant["shaft_cubic"]),
        }  # fmt: skip

    return law


LOAD = (
    BenchEffect(
        "load_torque", "mechanical", (), "rated torque", (0.01, 0.2),
        {"constant": _load, "wandering": _load_wandering},
    ),
    BenchEffect(
        "load_step", "mechanical", ("time",), "rated torque", (0.03, 0.3),
        {"sharp": _load_step(0.0), "sloped": _load_step(0.02)},
    ),
    BenchEffect(
        "cogging_torque", "mechanical", ("position",), "rated torque", (0.02, 0.2),
        {"one": _cogging((1.0,)), "two": _cogging((1.0, 0.4)), "three": _cogging((1.0, 0.5, 0.25))},
    ),
    BenchEffect(
        "inertia_change", "mechanical", ("time",), "all of J", (0.03, 0.3),
        {"heavier": _inertia(1.0), "lighter": _inertia(-1.0)},
    ),
    BenchEffect(
        "shaft_compliance", "mechanical", ("speed",),
        "0.03 over the resonance in rad a sample", (0.05, 0.3),
        {"linear": _compliance(0.0), "hardening": _compliance(0.5)},
    ),
)  # fmt: skip
