"""Diagnosis entries of the result: residual tests, missing terms and parameter shifts.

The result contains no time series; the report plots them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from identification.arrays import Array
from identification.diagnosis.detection import Detection
from identification.diagnosis.localise import Localisation, Missing
from identification.model.excitation import Record
from identification.result.entries import quantity_entry
from identification.selection.outcome import Outcome

__all__ = ["detection_entry", "shift_entries", "signals_at", "trace_entry"]

_DRIVERS: Final = ("current", "speed", "voltage", "temperature", "position", "time")
_STRETCHES: Final = 20
_BEYOND: Final = 3.0


def detection_entry(detection: Detection | None) -> dict[str, Any]:
    """Residual tests with their reasons; empty if they were not made."""
    if detection is None:
        return {}
    return {
        "missing": bool(detection.missing),
        "sentence": detection.sentence,
        "level": detection.level,
        "checks": [asdict(check) for check in detection.checks],
    }


def trace_entry(
    localisation: Localisation | None, outcome: Outcome | None, records: Sequence[Record]
) -> dict[str, Any]:
    """Missing term of each equation and its dependence on the drivers over the training records."""
    entry: dict[str, Any] = {}
    if localisation is not None:
        signals = signals_at(records, localisation.missing)
        for name, found in (
            ("electrical", localisation.electrical),
            ("mechanical", localisation.mechanical),
        ):
            series = [m.voltage if name == "electrical" else m.torque for m in localisation.missing]
            term = np.concatenate(series) if series else np.zeros(0)
            entry[name] = {
                "strength": found.strength,
                "unit": found.unit,
                "time_constant_s": found.time_constant,
                "log_likelihood_gain": found.gain,
                "p_value": found.p_value,
                "significant": bool(found.significant),
                "drivers": {
                    driver: {
                        "correlation": _correlation(term, values),
                        "share": _share(term, values),
                    }
                    for driver, values in signals.items()
                },
            }
    traces = outcome.traces if outcome else ()
    if traces:
        entry["curves"] = [
            {
                "equation": trace.equation,
                "driver": trace.driver,
                "log_likelihood_gain": trace.gain,
                "share": trace.share,
            }
            for trace in traces
        ]
    return entry


def signals_at(records: Sequence[Record], missing: Sequence[Missing]) -> dict[str, Array]:
    """Each driver at the sample times of the missing terms, all records concatenated."""
    by_start = {(record.run, record.start): record for record in records}
    columns: dict[str, list[Array]] = {name: [] for name in _DRIVERS}
    for piece in missing:
        record = by_start[piece.run, piece.start]
        known = {
            "current": record.measured[:, 0],
            "speed": record.measured[:, 1],
            "voltage": record.column("voltage"),
            "temperature": record.column("temperature"),
            "position": np.mod(record.column("angle"), 2 * np.pi),
            "time": record.time,
        }
        # Sample values without interpolation, because the angle wraps.
        at = np.clip(np.searchsorted(record.time, piece.time), 0, record.rows - 1)
        for name, values in known.items():
            columns[name].append(values[at])
    return {
        name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in columns.items()
    }


def _correlation(term: Array, driver: Array) -> float | None:
    """Pearson correlation; None if one of the two signals is constant."""
    if term.size < 3 or np.ptp(term) == 0.0 or np.ptp(driver) == 0.0:
        return None
    return float(np.corrcoef(term, driver)[0, 1])


def _share(term: Array, driver: Array) -> float | None:
    """Correlation ratio: fraction of a term's variance explained by its bin means over a driver.

    For a linear relation it equals the square of the correlation; a curve of any form raises it as
    well.  Bins hold equally many samples.

    Source: Fisher, Statistical Methods for Research Workers (1925), section 45.
    """
    if term.size < 5 * _STRETCHES or np.ptp(term) == 0.0 or np.ptp(driver) == 0.0:
        return None
    edges = np.unique(np.quantile(driver, np.linspace(0, 1, _STRETCHES + 1)[1:-1]))
    number = np.searchsorted(edges, driver, side="right")
    counts = np.bincount(number, minlength=edges.size + 1)
    means = np.bincount(number, term, edges.size + 1) / np.maximum(counts, 1)
    return float(np.clip(1.0 - np.var(term - means[number]) / np.var(term), 0.0, 1.0))


def shift_entries(
    parameters: Mapping[str, Mapping[str, Any]],
    declared: Mapping[str, Mapping[str, Any]],
    draws: Mapping[str, Array],
    declared_draws: Mapping[str, Array],
) -> dict[str, dict[str, Any]]:
    """Bias of each nominal-model parameter that the missing effects caused.

    Both fits use the same data, so their errors have a common part that cancels in the difference.
    The interval treats them as independent, which makes it too wide rather than too narrow; `off`
    requires three of its standard deviations.

    Returns:
        By name ``before``, ``after``, ``relative`` (nominal minus final, over the magnitude of the
        final value) and ``off``.
    """
    entries = {}
    for name, after in parameters.items():
        before = declared[name]
        count = min(draws[name].size, declared_draws[name].size)
        final, first = draws[name][:count], declared_draws[name][:count]
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = (first - final) / np.abs(final)
        quantity = quantity_entry(relative, "1")
        sure = before["identified"] and after["identified"]
        entries[name] = {
            "before": dict(before),
            "after": dict(after),
            "relative": quantity,
            "off": bool(sure and abs(quantity["mean"] or 0.0) > _BEYOND * (quantity["sd"] or 0.0)),
        }
    return entries
