"""Simulated fleets: two results for each motor, with drifts of known causes.

The errors of a result are normal with the standard deviations and the correlations of a fit of a
short campaign.  A drift changes the parameters along one cause of `identification.fleet.causes`, in
a random direction of it.  Every parameter also changes by the repeatability of campaigns.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification.fleet.causes import Cause
from identification.fleet.explanation import REPEATABILITY
from identification.fleet.refit import Estimate, Refit, Size, compared_with

__all__ = ["Z90", "estimate", "simulated_fleet"]

Array = NDArray[np.float64]

NAMES = (
    "Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L", "coulomb_friction.torque",
    "brush_drop.voltage", "viscous_temperature.rate",
)  # fmt: skip
VALUES = (1.1, 3.9e-3, 0.115, -1.2e-3, 1.2e-4, 6e-5, 2.6e-3, 8e-3, 0.6, 0.012)
RELATIVE_SDS = (0.001, 0.004, 0.001, 0.008, 0.002, 0.02, 0.002, 0.01, 0.01, 0.03)
_CORRELATED = {
    ("Ra25", "alpha_Ra"): -0.85,
    ("Kt25", "J"): 0.8,
    ("Kt25", "alpha_Kt"): -0.4,
    ("b", "coulomb_friction.torque"): -0.6,
    ("Ra25", "brush_drop.voltage"): -0.3,
}
_FRICTIONAL, _FRICTION_FACTOR = {"run_in", "grease", "bearing_wear"}, 5.0
Z90 = 1.645


def estimate(value: float, sd: float) -> Estimate:
    """Normal estimate with its 90 % interval."""
    value, sd = float(value), float(sd)
    return Estimate(value, sd, value - Z90 * sd, value + Z90 * sd, True)


def _correlations() -> Array:
    matrix = np.eye(len(NAMES))
    for (first, second), value in _CORRELATED.items():
        row, column = NAMES.index(first), NAMES.index(second)
        matrix[row, column] = matrix[column, row] = value
    return matrix


def _refit(name: str, values: Array, sds: Array, correlation: Array, with_effects: bool) -> Refit:
    estimates = {n: estimate(v, s) for n, v, s in zip(NAMES, values, sds, strict=True)}
    names = NAMES if with_effects else NAMES[:7]
    return Refit(
        name,
        "fitted",
        {n: estimates[n] for n in NAMES[:7]},
        sizes={n: Size(estimates[n], "", "") for n in names[7:]},
        correlation={
            (a, b): float(correlation[i, j])
            for i, a in enumerate(NAMES)
            for j, b in enumerate(NAMES)
        },
    )


def simulated_fleet(
    motors: int,
    rng: np.random.Generator,
    drifts: Mapping[int, tuple[Cause, float]],
    with_effects: bool = True,
) -> list[Refit]:
    """Simulate a fleet with two results for each motor.

    Args:
        motors: Number of motors.
        rng: Random numbers.
        drifts: Cause and relative size of the drift by motor.
        with_effects: Whether the models contain friction, brush drop and grease effects.
    """
    correlation = _correlations()
    fleet = []
    for number in range(motors):
        true = np.array(VALUES) * np.exp(0.03 * rng.normal(size=len(NAMES)))
        sds = np.abs(true) * RELATIVE_SDS * rng.uniform(0.5, 2.0)
        lower = np.linalg.cholesky(correlation) * sds[:, None]
        changed = true * (1.0 + REPEATABILITY * rng.normal(size=len(NAMES)))
        if number in drifts:
            cause, size = drifts[number]
            size *= _FRICTION_FACTOR if cause.name in _FRICTIONAL else 1.0
            before = dict(zip(NAMES, true.tolist(), strict=True))
            shown = [
                direction
                for direction in cause.directions(before)
                if with_effects or {*direction} & {*NAMES[:7]}
            ]
            direction = shown[int(rng.integers(len(shown)))]
            largest = max(abs(v) for v in direction.values())
            relative = np.array([direction.get(name, 0.0) for name in NAMES]) / largest
            changed = changed * np.exp(size * relative)
        first, second = (
            _refit(f"motor {number}", values + lower @ rng.normal(size=len(NAMES)), sds,
                   correlation, with_effects)
            for values in (true, changed)
        )  # fmt: skip
        fleet.append(compared_with(second, first))
    return fleet
