"""Judgement of a controller in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from identification.result.numbers import unit_prefix
from identification.tuning.specification import METRICS

__all__ = ["statement"]

_LEAST_RISE: Final = 0.02


def statement(
    entry: Mapping[str, Any],
    probability: float,
    step: float,
    reach: float | None,
    fastest: float | None,
) -> str:
    """Sentences: if a controller meets the specification, by how much it does not, and where.

    `step` is the step of the reference, `reach` the steady speed that the drive reaches [rad/s] and
    `fastest` the rise time with the drive at its limits [s], both None without limits.
    """
    by_drive = [] if entry["meets"] else _drive(entry["worst"], step, reach, fastest)
    return "; ".join(
        [
            *_judgement(entry, probability),
            *(by_drive or _blame(entry)),
            *_hunting(entry),
        ]
    )


def _judgement(entry: Mapping[str, Any], probability: float) -> list[str]:
    worst = entry["worst"]
    label = worst["metric"].replace("_", " ")
    share = f"{100 * entry['probability']:.3g} %"
    if entry["meets"]:
        first = f"{entry['controller']} meets the specification in {share} of the draws"
        if worst["value"] is None:
            return [first]
        return [
            first,
            f"closest to its limit is the {label} at {worst['temperature_degC']:g} °C: "
            f"{_value(worst)} at the {100 * worst['quantile']:.3g} % quantile, "
            f"limit {_value(worst, 'limit')}",
        ]
    words = [
        f"{entry['controller']} meets the specification in {share} of the draws; "
        f"{100 * probability:.3g} % are required"
    ]
    at = f"at {worst['temperature_degC']:g} °C"
    if worst["value"] is None:
        words.append(
            f"{at} the {label} does not exist in too many draws: the speed does not settle"
        )
    else:
        side = "above" if METRICS[worst["metric"]].is_upper else "below"
        words.append(
            f"the {label} {at} is {_value(worst)} at the {100 * worst['quantile']:.3g} % quantile, "
            f"{abs(100 * worst['slack']):.3g} % {side} the limit of {_value(worst, 'limit')}"
        )
    return words


def _drive(
    worst: Mapping[str, Any], step: float, reach: float | None, fastest: float | None
) -> list[str]:
    """The limits of the drive, if no controller can meet the specification within them."""
    if reach is not None and step > reach:
        return [
            f"the limits of the drive allow {reach:.3g} rad/s, less than the step of {step:g} rad/s"
        ]
    if worst["metric"] != "rise_time" or fastest is None or fastest <= worst["limit"]:
        return []
    return [
        f"the limits of the drive are to blame: with voltage or current at its limit, a step of "
        f"{step:g} rad/s rises in {_value({**worst, 'value': fastest})} at the same quantile, so "
        "no gains meet the specification"
    ]


def _blame(entry: Mapping[str, Any]) -> list[str]:
    """The parameter whose uncertainty costs most, if the specification is not met."""
    if entry["meets"] or not entry["blame"]:
        return []
    first = entry["blame"][0]
    if first["rise"] < _LEAST_RISE:
        return ["no single uncertainty explains it"]
    name = first["parameter"]
    cause = "the temperature range" if name == "temperature" else f"the uncertainty of {name}"
    known = "at the middle temperature" if name == "temperature" else "if it were known"
    return [
        f"{cause} is most to blame: {known}, {100 * first['probability']:.3g} % of the draws would "
        "meet the specification"
    ]


def _hunting(entry: Mapping[str, Any]) -> list[str]:
    """The largest reference of each kind of behaviour."""
    words = []
    for kind in dict.fromkeys(one["kind"] for one in entry["hunting"]):
        found = [one for one in entry["hunting"] if one["kind"] == kind]
        worst = max(found, key=lambda one: (one["reference_rad_s"], one["probability"]))
        at = (
            f"at a reference of {worst['reference_rad_s']:.3g} rad/s and "
            f"{worst['temperature_degC']:g} °C in {100 * worst['probability']:.3g} % of the draws"
        )
        if kind == "standstill":
            words.append(f"the shaft does not turn {at}")
            continue
        label = "stick-slip" if kind == "stick-slip" else "a limit cycle"
        words.append(
            f"{label} {at}: amplitude {worst['amplitude_rad_s']:.3g} rad/s, period "
            f"{worst['period_s']:.3g} s"
        )
    return words


def _value(worst: Mapping[str, Any], key: str = "value") -> str:
    """Value or limit with its unit; both have the unit of the limit, such as ms."""
    factor, unit = unit_prefix(worst["unit"], [worst["limit"]])
    return f"{factor * worst[key]:.3g} {unit}"
