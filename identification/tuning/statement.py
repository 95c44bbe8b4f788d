"""Judgement of a controller in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from identification.tuning.specification import METRICS

__all__ = ["statement"]

LABELS: Final = {
    "rise_time": "rise time",
    "settling_time": "settling time",
    "overshoot": "overshoot",
    "steady_error": "steady error",
    "gain_margin": "gain margin",
    "phase_margin": "phase margin",
}


def statement(
    entry: Mapping[str, Any], probability: float, step: float, reach: float | None
) -> str:
    """Whether a controller meets the specification, by how much not, and where.

    Args:
        entry: Entry of the controller.
        probability: Required fraction of the draws.
        step: Step of the reference [rad/s].
        reach: Steady speed that the drive reaches; None without limits [rad/s].
    """
    worst = entry["worst"]
    label = LABELS[worst["metric"]]
    share = f"{100 * entry['probability']:.3g} %"
    if entry["meets"]:
        first = f"{entry['controller']} meets the specification in {share} of the draws"
        if worst["value"] is None:
            return first
        return (
            f"{first}; closest to its limit is the {label} at {worst['temperature_degC']:g} degC: "
            f"{_value(worst)} at the {100 * worst['quantile']:.3g} % quantile, "
            f"limit {worst['limit']:g} {worst['unit']}"
        )
    words = [
        f"{entry['controller']} meets the specification in {share} of the draws; "
        f"{100 * probability:.3g} % are required"
    ]
    at = f"at {worst['temperature_degC']:g} degC"
    if worst["value"] is None:
        words.append(
            f"{at} the {label} does not exist in too many draws: the speed does not settle"
        )
    else:
        side = "above" if METRICS[worst["metric"]].is_upper else "below"
        words.append(
            f"the {label} {at} is {_value(worst)} at the {100 * worst['quantile']:.3g} % quantile, "
            f"{abs(100 * worst['slack']):.3g} % {side} the limit of {worst['limit']:g} "
            f"{worst['unit']}"
        )
    if reach is not None and step > reach:
        words.append(
            f"the limits of the drive allow {reach:.3g} rad/s, less than the step of {step:g} rad/s"
        )
    return "; ".join(words)


def _value(worst: Mapping[str, Any]) -> str:
    return f"{worst['value']:.3g} {worst['unit']}"
