"""Rows of the report tables as text, from the result and the runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.quantities import DECLARED_PARAMETERS
from identification.reporting.loops import METRICS, MetricRow, metric_row
from identification.result.effect_texts import effect_words
from identification.result.entries import Entry, known_only_from
from identification.result.numbers import (
    UNKNOWN,
    Interval,
    count_text,
    entry_text,
    interval_text,
    number_text,
    percent_text,
    signed_percent_text,
    unit_prefix,
    unit_text,
    with_symbols,
)
from identification.result.report_data import ReportData, RunTraces
from identification.result.residuals import channel_errors, channel_whiteness

__all__ = [
    "ErrorRow",
    "FeedbackTable",
    "ParameterRow",
    "error_rows",
    "feedback_tables",
    "parameter_rows",
    "run_rows",
    "sampler_rows",
]

_SOURCES = {
    "Ra25": "eq. 11",
    "alpha_Ra": "eq. 11: 0.0040 for copper",
    "Kt25": "eqs. 1, 2 and 12",
    "alpha_Kt": "eq. 12: −0.0020 for the magnet",
    "J": "eqs. 3–6",
    "b": "eqs. 3–6",
    "L": "eqs. 3–6",
}


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of the final model; ``shift`` is the relative error of the nominal model."""

    name: str
    meaning: str
    unit: str
    value: Interval
    is_identified: bool
    reason: str
    source: str
    before: Interval | None
    shift: str
    shift_bounds: str = ""


@dataclass(frozen=True)
class ErrorRow:
    """One channel on the runs of one role, before and after: RMSE, NRMSE and noise ratio."""

    role: str
    channel: str
    unit: str
    before: tuple[str, str, str]
    after: tuple[str, str, str]
    change: str


@dataclass(frozen=True)
class FeedbackTable:
    """Closed-loop metrics of one controller: one column per temperature, one row per metric.

    `statements` says for each temperature whether the loop is stable, if the result states it.
    """

    controller: str
    temperatures: tuple[str, ...]
    rows: tuple[MetricRow, ...]
    statements: tuple[str, ...]


def parameter_rows(data: ReportData) -> list[ParameterRow]:
    """Parameters of the motor, then those of each effect."""
    result = data.result
    declared: Entry = result["declared"]["parameters"]
    has_effects = bool(result["effects"])
    rows = [
        _parameter_row(name, entry, data, declared.get(name) if has_effects else None)
        for name, entry in result["parameters"].items()
    ]
    for effect in result["effects"]:
        words = effect_words(effect["name"])
        for name, entry in effect["parameters"].items():
            if name not in result["parameters"]:
                meaning = entry.get("meaning")
                text = f"{words}: {meaning}" if meaning else f"of {words}"
                rows.append(replace(_parameter_row(name, entry, data, None), meaning=text))
        for run in effect.get("runs") or ():
            text = f"{words} in {run['file']}"
            rows += [
                replace(_parameter_row(name, entry, data, None), meaning=text)
                for name, entry in run["values"].items()
            ]
    return rows


def run_rows(data: ReportData) -> list[Entry]:
    """Extent of each run, and for each channel fit, noise ratio and p-value of the whiteness."""
    noise = data.result["noise"]
    return [
        dict(
            name=run.name,
            role=run.role,
            rows=count_text(run.time.size),
            duration=f"{number_text(float(run.time[-1] - run.time[0]), 3)} s",
            temperature=_temperature_text(run),
            current=_channel_texts(run, "current", noise["current_A"]),
            speed=_channel_texts(run, "speed", noise["speed_rad_s"]),
        )
        for run in data.runs
    ]


def error_rows(result: Entry) -> list[ErrorRow]:
    """Errors of the nominal and the final model, validation runs first because they decide."""
    rows = []
    for role in ("validation", "training"):
        for channel, unit in (("current", "A"), ("speed", "rad/s")):
            before, after = (
                (result["errors"][stage].get(role) or {}).get(channel)
                for stage in ("before", "after")
            )
            if before is not None and after is not None:
                change = _change(before["rmse"], after["rmse"])
                texts = _error_texts(before), _error_texts(after)
                rows.append(ErrorRow(role, channel, unit, *texts, change))
    return rows


def feedback_tables(feedback: Sequence[Entry]) -> list[FeedbackTable]:
    """One table per controller, temperatures from cold to hot."""
    tables = []
    for controller in dict.fromkeys(str(entry["controller"]) for entry in feedback):
        entries = sorted(
            (entry for entry in feedback if entry["controller"] == controller),
            key=lambda entry: float(entry["temperature_degC"]),
        )
        rows = tuple(
            metric_row(label, [entry[key] for entry in entries])
            for key, label in METRICS.items()
            if all(entry.get(key) is not None for entry in entries)
        )
        columns = tuple(f"{entry['temperature_degC']:g} °C" for entry in entries)
        statements = tuple(str(entry.get("statement", "")) for entry in entries)
        tables.append(FeedbackTable(controller, columns, rows, statements))
    return tables


def sampler_rows(data: ReportData) -> list[tuple[str, str, str, str]]:
    """Label, value, criterion and verdict of each diagnostic of the sampler; empty without one.

    Criterion and verdict are empty if no warning depends on the diagnostic.
    """
    sampler, chain = data.result["sampler"], data.posterior
    if not sampler or chain is None:
        return []
    size = f"{count_text(sampler['walkers'])} × {count_text(sampler['steps'])}"
    length, r_hat = sampler["steps"] / sampler["autocorrelation_time"], sampler["r_hat_max"]
    long, mixed = length >= chain.least_length, r_hat <= chain.largest_r_hat
    return [
        ("Walkers × steps after burn-in", size, "", ""),
        (
            "Length of the chain",
            f"{number_text(length, 3)} autocorrelation times",
            f"at least {chain.least_length:g}",
            "yes" if long else "no",
        ),
        (
            "R-hat, largest",
            number_text(r_hat, 4),
            f"at most {chain.largest_r_hat:g}",
            "yes" if mixed else "no",
        ),
        ("Effective sample size, smallest", number_text(sampler["ess_min"], 3), "", ""),
        ("Acceptance", percent_text(sampler["acceptance"], 2), "", ""),
    ]


def _parameter_row(
    name: str, entry: Entry, data: ReportData, declared: Entry | None
) -> ParameterRow:
    known = DECLARED_PARAMETERS.get(name)
    is_identified = bool(entry["identified"])
    reason = "" if is_identified else data.reasons.get(name, "the runs do not determine it")
    if origin := known_only_from(entry):
        is_identified, reason = False, f"from {origin}, not from the runs"
    ends = [one["median"] for one in (entry, declared) if one]
    # The bias of a parameter that the runs do not determine is that of its prior.
    shift, bounds = "", ""
    if declared and entry["identified"]:
        shift, bounds = _shift(name, declared, entry, data.result)
    factor, unit = unit_prefix(entry["unit"], ends)
    return ParameterRow(
        name=name,
        meaning=with_symbols(known.meaning) if known else "",
        unit=unit_text(unit),
        value=entry_text(entry, factor),
        is_identified=is_identified,
        reason=reason,
        source=_SOURCES.get(name, ""),
        before=entry_text(declared, factor) if declared else None,
        shift=shift,
        shift_bounds=bounds,
    )


def _channel_texts(run: RunTraces, channel: str, noise: float | None) -> tuple[str, str, str]:
    value, errors = channel_whiteness(run, channel), channel_errors(run, channel)
    p = UNKNOWN if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"
    return (
        percent_text(1.0 - errors.nrmse, 4) if errors else UNKNOWN,
        number_text(errors.rmse / noise if errors and noise else None, 3),
        p,
    )


def _temperature_text(run: RunTraces) -> str:
    if run.temperature is None or not np.isfinite(run.temperature).any():
        return "not logged"
    low, high = np.nanmin(run.temperature), np.nanmax(run.temperature)
    return f"{low:.0f} °C" if high - low < 1.0 else f"{low:.0f}–{high:.0f} °C"


def _error_texts(entry: Entry) -> tuple[str, str, str]:
    return (
        number_text(entry["rmse"], 3),
        percent_text(entry["nrmse"], 3),
        number_text(entry["noise_ratio"], 4),
    )


def _change(before: float | None, after: float | None) -> str:
    """Relative change of the RMSE; unknown if both models have the same error."""
    if not before or after is None or before == after:
        return UNKNOWN
    return signed_percent_text(after / before - 1.0)


def _shift(name: str, declared: Entry, final: Entry, result: Entry) -> tuple[str, str]:
    """Deviation of the nominal model in per cent of the final value, and its 90 % interval."""
    relative = ((result["diagnosis"].get("shifts") or {}).get(name) or {}).get("relative") or {}
    ends = [relative[key] for key in ("q05", "median", "q95") if relative.get(key) is not None]
    if len(ends) == 3:
        decimals = len(interval_text(0.0, 100.0 * ends[0], 100.0 * ends[2]).low.partition(".")[2])
        low, middle, high = (f"{100.0 * end:+.{decimals}f}".replace("-", "−") for end in ends)
        return f"{middle} %", f"{low} … {high} %"
    if declared["median"] is None or not final["median"]:
        return UNKNOWN, ""
    change = (declared["median"] - final["median"]) / abs(final["median"])
    return signed_percent_text(change), ""
