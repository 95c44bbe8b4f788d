"""Thermal effects: self-heating, thermal lags, nonlinear resistance, demagnetisation."""

from __future__ import annotations

import numpy as np

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["THERMAL"]


def _heating(fast: float, turning: float) -> Law:
    """Self-heating of the winding: one node, a second fast node, or additional iron loss."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        rise = size / setup.motor.alpha_Ra
        time = setup.rng.uniform(0.15, 0.4) * setup.duration
        setup.plant["heat_rise"] = (1.0 - fast) * rise
        setup.plant["heat_time"] = time
        setup.plant["heat_rise_2"] = fast * rise
        setup.plant["heat_time_2"] = 0.15 * time if fast > 0.0 else 0.0
        setup.plant["heat_speed"] = turning * rise
        return {"rise_at_rated_loss": rise, "time": time, "fast_share": fast, "iron_share": turning}

    return law


def _lag(prefix: str, order: int) -> Law:
    """First- or second-order lag behind the logged temperature, with the same total delay."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        time = size * setup.duration / order
        setup.plant[prefix] = time
        setup.plant[f"{prefix}_order"] = float(order)
        return {"time": time, "order": float(order)}

    return law


def _curvature(setup: Setup, size: float) -> dict[str, float]:
    """Quadratic resistance Ra25 (1 + alpha dT + c dT^2)."""
    curvature = setup.sign * size / 1e4
    setup.plant["curvature"] = curvature
    return {"curvature": curvature}


def _curvature_cubic(setup: Setup, size: float) -> dict[str, float]:
    """Quadratic and cubic resistance terms with equal contributions at dT = 100 K."""
    sign = setup.sign
    setup.plant["curvature"] = 0.5 * sign * size / 1e4
    setup.plant["curvature_cubic"] = 0.5 * sign * size / 1e6
    return {"curvature": 0.5 * sign * size / 1e4, "cubic": 0.5 * sign * size / 1e6}


def _demagnetization(is_gradual: bool) -> Law:
    """Irreversible loss of Kt above a magnet temperature that the hottest training run reaches."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        training = [run for run in setup.runs if run.role == "training"] or setup.runs
        peaks = np.sort([run.temperature.max() for run in training])
        coolest = peaks[-2] if peaks.size > 1 else setup.runs[0].temperature.min()
        span = peaks[-1] - coolest
        start = coolest + (0.3 if is_gradual else setup.rng.uniform(0.4, 0.7)) * span
        stop = coolest + 0.8 * span if is_gradual else start
        setup.plant["demagnetization"] = min(size, 0.9)
        setup.plant["demagnetization_from"] = start
        setup.plant["demagnetization_to"] = stop
        return {"lost": min(size, 0.9), "from_degC": float(start), "to_degC": float(stop)}

    return law


THERMAL = (
    BenchEffect(
        "self_heating", "thermal", ("current",), "all of Ra25 added in balance at rated current",
        (0.02, 0.15),
        {
            "one_node": _heating(0.0, 0.0),
            "two_nodes": _heating(0.4, 0.0),
            "with_iron": _heating(0.0, 0.25),
        },
    ),
    BenchEffect(
        "winding_lag", "thermal", ("temperature",), "a lag as long as a run", (0.03, 0.2),
        {"one_stage": _lag("winding_lag", 1), "two_stages": _lag("winding_lag", 2)},
    ),
    BenchEffect(
        "magnet_lag", "thermal", ("temperature",), "a lag as long as a run", (0.05, 0.3),
        {"one_stage": _lag("magnet_lag", 1), "two_stages": _lag("magnet_lag", 2)},
    ),
    BenchEffect(
        "resistance_curvature", "thermal", ("temperature",), "all of Ra25 at 125 degC",
        (0.02, 0.12), {"square": _curvature, "with_cubic": _curvature_cubic},
    ),
    BenchEffect(
        "demagnetization", "thermal", ("temperature", "time"), "all of Kt25", (0.01, 0.1),
        {"sharp": _demagnetization(False), "gradual": _demagnetization(True)},
    ),
)  # fmt: skip
