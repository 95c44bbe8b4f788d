"""Closed-loop metrics in words and tables: cold and hot, nominal, final and simulated models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from identification.result.effect_texts import effect_words
from identification.result.entries import Entry
from identification.result.numbers import (
    UNKNOWN,
    Interval,
    entry_text,
    interval_text,
    listed,
    number_text,
    unit_prefix,
    unit_text,
)

__all__ = [
    "METRICS",
    "MetricRow",
    "cold_and_hot",
    "is_left_open",
    "loop_comparisons",
    "loop_sentence",
    "metric_row",
    "metric_text",
    "pair_text",
    "single_text",
]

MetricRow = tuple[str, str, tuple[Interval, ...]]
"""Label, unit and cells of one metric."""

METRICS: Final = {
    "rise_time_s": "Rise time, 10–90 %",
    "settling_time_s": "Settling time, 2 %",
    "steady_state": "Final value",
    "overshoot_percent": "Overshoot",
    "peak": "Peak",
    "peak_time_s": "Peak time",
    "bandwidth_rad_s": "Bandwidth",
    "phase_margin_deg": "Phase margin",
    "gain_margin_db": "Gain margin",
}
_LABELS: Final = {
    "feedback_before": "nominal model",
    "feedback": "final model",
    "feedback_nonlinear": "final model, effects simulated",
}
_MOST: Final = 0.5
"""Fraction of infinite draws above which a margin is written as infinite."""
_WIDE: Final = 0.2
"""Relative width of the 90 % interval above which a closed-loop figure is no prediction [-]."""


def loop_comparisons(result: Entry) -> list[Entry]:
    """Metrics of each controller, at each temperature a column for each model (`ways`).

    Empty if only one model has metrics.
    """
    labels = {key: words for key, words in _LABELS.items() if result.get(key)}
    if len(labels) < 2:
        return []
    controllers = dict.fromkeys(str(entry["controller"]) for entry in result["feedback"])
    return [_comparison(controller, result, labels) for controller in controllers]


def _comparison(controller: str, result: Entry, labels: Mapping[str, str]) -> Entry:
    found = {
        key: {
            float(entry["temperature_degC"]): entry
            for entry in result[key]
            if entry["controller"] == controller
        }
        for key in labels
    }
    kept = [key for key in labels if found[key]]
    temperatures = sorted(found["feedback"])
    cells = [found[key].get(t, {}) for t in temperatures for key in kept]
    rows = []
    for metric, label in METRICS.items():
        entries = [cell.get(metric) for cell in cells]
        known = [entry for entry in entries if entry is not None]
        if any(metric_text(entry).median != UNKNOWN for entry in known):
            rows.append(metric_row(label, entries))
    return dict(
        controller=controller,
        temperatures=tuple(f"{t:g} °C" for t in temperatures),
        ways=tuple(labels[key] for key in kept),
        rows=tuple(rows),
        remark=_remark(list(found.get("feedback_nonlinear", {}).values())),
    )


def _remark(simulated: Sequence[Entry]) -> str:
    if not simulated:
        return ""
    first = simulated[0]
    words = " and ".join(effect_words(name) for name in first["effects"])
    ends = "; ".join(f"at {e['temperature_degC']:g} °C {e['statement']}" for e in simulated)
    return (
        f"The loop with {words} is nonlinear, so its response depends on the step size. The "
        f"simulated reference step from standstill is {number_text(first['step_rad_s'], 2)} rad/s, "
        "the largest step whose linear response stays within the speeds, currents and voltages of "
        "the training runs. Peak and final value are divided by the step. Speed after the step: "
        f"{ends}. Margins and bandwidth are defined for linear loops only."
    )


def metric_row(label: str, entries: Sequence[Entry | None]) -> MetricRow:
    """Label, unit and cells of one metric; the cells share the unit, such as ms.

    At least one of the quantities is known.
    """
    known = [entry for entry in entries if entry is not None]
    factor, unit = unit_prefix(known[0]["unit"], [entry["median"] for entry in known])
    return label, unit_text(unit), tuple(metric_text(entry, factor) for entry in entries)


def metric_text(entry: Entry | None, factor: float = 1.0) -> Interval:
    """Format a metric; a margin that is infinite for most draws is written as infinite.

    `factor` converts the unit of the result to the unit shown.
    """
    if entry is None:
        return interval_text(None, None, None)
    if entry["median"] is None and entry.get("infinite_fraction", 0.0) > _MOST:
        return Interval("infinite", UNKNOWN, UNKNOWN, "")
    return entry_text(entry, factor)


def loop_sentence(result: Entry) -> str:
    """Change of the first controller's loop from cold to hot; empty without two temperatures."""
    ends = cold_and_hot(result["feedback"])
    if ends is None:
        return ""
    cold, hot = ends
    words = {"rise_time_s": "the rise time", "steady_state": "the final value"}
    units = {"steady_state": "of the reference", "rise_time_s": "s"}
    left_open = [name for name in words if is_left_open(result, ends, name)]
    lead = f"With the controller {cold['controller']} and unity feedback of the speed"
    if unstable := [end for end in ends if _is_undefined(end, words)]:
        end = unstable[0]
        share = end["statement"].partition(";")[0].partition(":")[0]
        return (
            f"{lead}, the loop is {share} at {end['temperature_degC']:g} °C, so that no rise time "
            "and no final value are given for it."
        )
    if len(left_open) == len(words):
        return (
            f"{lead}, these runs do not determine the rise time and the final value; the values "
            "shown are not predictions."
        )
    changes = [
        f"{words[name]} from {pair_text(cold[name], hot[name], ' to ', unit)}"
        for name, unit in units.items()
        if name not in left_open
    ]
    hot_alone = f" at {hot['temperature_degC']:g} °C"
    undetermined = [
        words[name] + ("" if is_left_open(result, [cold], name) else hot_alone)
        for name in left_open
    ]
    sentence = (
        f"{lead}, heating from {cold['temperature_degC']:g} °C to {hot['temperature_degC']:g} °C "
        f"changes {listed(changes)}"
    )
    return "; these runs do not determine ".join([sentence, *undetermined]) + "."


def _is_undefined(end: Entry, names: Iterable[str]) -> bool:
    """True if the loop at one temperature is unstable so often that a metric has no median."""
    known = (end.get(name) for name in names)
    is_stable = end.get("stable_probability", 1.0) == 1.0
    return not is_stable and any(one and one["median"] is None for one in known)


def is_left_open(result: Entry, ends: Sequence[Entry], name: str) -> bool:
    """True if a closed-loop figure is uncertain because a parameter is not identified.

    If all parameters are identified, a wide interval is still a measurement.
    """
    if all(entry["identified"] for entry in result["parameters"].values()):
        return False
    entries = [end[name] for end in ends if end.get(name) and end[name]["median"] is not None]
    return any(
        entry["q95"] is None or entry["q95"] - entry["q05"] > _WIDE * abs(entry["median"])
        for entry in entries
    )


def cold_and_hot(feedback: Sequence[Entry]) -> tuple[Entry, Entry] | None:
    """Coldest and hottest entry of the first controller; None with fewer than two temperatures."""
    if not feedback:
        return None
    first = [entry for entry in feedback if entry["controller"] == feedback[0]["controller"]]
    ordered = sorted(first, key=lambda entry: float(entry["temperature_degC"]))
    return (ordered[0], ordered[-1]) if len(ordered) > 1 else None


def pair_text(cold: Entry | None, hot: Entry | None, between: str, unit: str) -> str:
    """Two medians with their unit; times below 1 s in milliseconds or microseconds."""
    factor, shown = unit_prefix(unit, [entry["median"] for entry in (cold, hot) if entry])
    return f"{_median(cold, factor)}{between}{_median(hot, factor)} {shown}".rstrip()


def single_text(entry: Entry | None, unit: str) -> str:
    """One median with its unit, as in `pair_text`."""
    factor, shown = unit_prefix(unit, [entry["median"]] if entry else [])
    return f"{_median(entry, factor)} {shown}".rstrip()


def _median(entry: Entry | None, factor: float) -> str:
    if entry is None:
        return UNKNOWN
    if entry["median"] == 0.0:
        # Without its interval, a power of ten beside it has no meaning.
        return "0"
    written = entry_text(entry, factor)
    if len(written.median) > 5:
        return number_text(factor * entry["median"], 3)
    return written.median + written.power
