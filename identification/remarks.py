"""Remarks on a predicted run: contradictions in its measured channels, and extrapolation.

A prediction needs the measured current and speed for the initial state only, so a run that a fit
would refuse is predicted nevertheless.  Its errors may then say nothing about the model.

A measured channel with a wrong sign or scale is proportional to its prediction.  The first quarter
of a run is left out, because a wrong scale is in the initial state, too.

A model is confirmed where it was fitted.  Beyond, the temperature coefficients, friction and every
curve are extrapolated, and nothing in the prediction shows it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from identification.arrays import Array
from identification.checks.balance import signals_of
from identification.checks.campaign import check_runs
from identification.checks.consistency import scale_of
from identification.checks.dead import dead_findings
from identification.checks.finding import Finding, factor
from identification.ingest.run import Run
from identification.result.numbers import finite, number_text
from identification.warning import both_ways

__all__ = ["contradictions", "extrapolation", "remarks_on"]

_START: Final = 0.25
"""Fraction of the samples at the start that is left out [-]."""
_FEWEST: Final = 50
_PROPORTIONAL: Final = 0.95
"""Correlation with the prediction from which a channel is proportional to it [-]."""
_FACTOR: Final = 1.8
"""Slope over the prediction that no temperature explains [-]: 100 K more give copper 1.39 times the
resistance and ferrite 0.8 times the torque constant, together a factor of 1.74."""
_UNEXPLAINED: Final = 0.8
"""Fraction of the variance of a channel from which the prediction does not follow it [-]."""
_NOISE: Final = 10.0
"""Error over the noise of the fit up to which a channel may have no signal to explain [-]."""
_MARGIN: Final = 0.1
"""Fraction of the fitted range by which a run may leave it [-]: noise and single peaks."""
_WARMER: Final = 5.0
"""The same for the temperature [K], where runs of one temperature have no range: copper changes its
resistance by 2 %, what an added effect has to explain at least."""


def remarks_on(result: Mapping[str, Any], run: Run, predicted: pd.DataFrame) -> list[str]:
    """Sentences on the limits of a prediction, as `predict` returns it; empty if it has none."""
    found = contradictions(result, run, predicted)
    remarks = [_sentence(run, found)] if found else []
    beyond = extrapolation(result, run, predicted)
    return [*remarks, beyond] if beyond else remarks


@np.errstate(all="ignore")
def contradictions(
    result: Mapping[str, Any], run: Run, predicted: pd.DataFrame
) -> Sequence[Finding]:
    """Contradictions of a run in itself, or else with its prediction.

    A run without readings has nothing to compare.
    """
    if not run.has_readings:
        return ()
    constant = [np.ptp(channel) == 0.0 for channel in (run.current, run.speed)]
    refused = check_runs([run]).refused
    if refused or any(constant):
        return refused or list(dead_findings(run, signals_of(run)))
    pairs = {
        name: _compared(run, name, predicted[name].to_numpy())
        for name in ("current_A", "speed_rad_s")
    }
    if any(measured.size < _FEWEST for measured, _ in pairs.values()):
        return ()
    slopes = {name: _slope(*pair) for name, pair in pairs.items()}
    known = {name: slope for name, slope in slopes.items() if slope is not None}
    if any(slope < 0.0 for slope in known.values()):
        return [_reversed(run, known)]
    noise = result.get("noise") or {}
    lost = [
        name for name in slopes if name not in known and _is_lost(*pairs[name], noise.get(name))
    ]
    return _scaled(run, known) or [_foreign(run, name, *pairs[name]) for name in lost[:1]]


def _compared(run: Run, name: str, predicted: Array) -> tuple[Array, Array]:
    """Measured and predicted samples of a channel that are compared, (n_compared,) each."""
    kept = np.isfinite(predicted) & ~run.omitted(name)
    kept[: int(_START * run.rows)] = False
    return run.between_updates(name)[kept], predicted[kept]


def _slope(measured: Array, predicted: Array) -> float | None:
    """Slope of a channel over its prediction; None if it is not proportional to it."""
    measured, predicted = measured - measured.mean(), predicted - predicted.mean()
    size, common = float(predicted @ predicted), float(measured @ predicted)
    both = math.sqrt(size * float(measured @ measured))
    return common / size if both > 0.0 and abs(common) > _PROPORTIONAL * both else None


def _unexplained(measured: Array, predicted: Array) -> float:
    """Mean square of the prediction error over the variance of the channel [-]."""
    return float(np.mean((measured - predicted) ** 2) / np.var(measured))


def _is_lost(measured: Array, predicted: Array, noise: object) -> bool:
    """True if a prediction misses a channel, whose noise in the fit is known and small."""
    error = math.sqrt(float(np.mean((measured - predicted) ** 2)))
    is_signal = isinstance(noise, int | float) and error > _NOISE * noise
    return is_signal and _unexplained(measured, predicted) > _UNEXPLAINED


def _reversed(run: Run, slopes: Mapping[str, float]) -> Finding:
    """Finding for a channel with the opposite sign; a reversed voltage reverses both others."""
    negative = [name for name, slope in slopes.items() if slope < 0.0]
    name = negative[0] if len(negative) == 1 else "voltage_V"
    return Finding(
        "reversed_channel",
        "refuse",
        run.name,
        name,
        f"has the wrong sign: the prediction is the opposite of {' and of '.join(negative)}",
        f"slope of {negative[0]} over the prediction",
        slopes[negative[0]],
        0.0,
        (factor(run, name, -1.0),),
    )


def _scaled(run: Run, slopes: Mapping[str, float]) -> list[Finding]:
    """Finding for a channel whose values are a multiple of those predicted; empty if none is."""
    worst = max(slopes, key=lambda name: abs(math.log(slopes[name])), default=None)
    if worst is None or abs(math.log(slopes[worst])) < math.log(_FACTOR):
        return []
    # Speed over voltage is 1 / Kt, current over voltage 1 / Ra.
    current, speed = (slopes.get(name, 1.0) for name in ("current_A", "speed_rad_s"))
    named = scale_of(1.0 / speed, 1.0 / current)
    slope = slopes[worst]
    channel, size, unit = named or (worst, slope, "")
    cause = f"; the values are probably in {unit}" if unit else ""
    if named is None:
        cause = ": another motor or another load than in the fitted runs, or a wrong scale"
    return [
        Finding(
            "foreign_motor" if named is None else "scaled_channel",
            "refuse",
            run.name,
            channel,
            f"the values are {size:.4g} times those of the prediction{cause}",
            f"slope of {worst} over the prediction",
            slope,
            _FACTOR if slope > 1.0 else 1.0 / _FACTOR,
            (factor(run, channel, 1.0 / size),) if named else (),
        )
    ]


def _foreign(run: Run, name: str, measured: Array, predicted: Array) -> Finding:
    return Finding(
        "foreign_motor",
        "refuse",
        run.name,
        name,
        "the prediction does not follow it: another motor or another load than in the fitted runs, "
        "or a wrong column",
        "unexplained fraction of the variance",
        _unexplained(measured, predicted),
        _UNEXPLAINED,
    )


def _sentence(run: Run, found: Sequence[Finding]) -> str:
    ways = f"correct the run with {both_ways('map')}" if any(f.corrections for f in found) else ""
    text = "; ".join(f"({number}) {finding}" for number, finding in enumerate(found, 1))
    return (
        f"{run.name} contradicts physics or the result; {ways or 'check the run'} before you judge "
        f"the model by the errors of this prediction: {text}"
    )


def extrapolation(result: Mapping[str, Any], run: Run, predicted: pd.DataFrame) -> str:
    """Sentence on the channels in which a run leaves the range of the training runs; else empty.

    Voltage and temperature are those of the run, current and speed those of the prediction.  A
    result whose runs have no ranges, of an earlier version, has no remark.
    """
    reached = {
        "voltage_V": ("V", run.voltage),
        "current_A": ("A", predicted["current_A"].to_numpy()),
        "speed_rad_s": ("rad/s", predicted["speed_rad_s"].to_numpy()),
        "temperature_degC": ("°C", run.temperature),
    }
    beyond = [
        text
        for name, (unit, values) in reached.items()
        if values is not None and (text := _beyond(name, unit, values, _fitted(result, name)))
    ]
    if not beyond:
        return ""
    return (
        f"{run.name} leaves the range of the fitted runs ({'; '.join(beyond)}), where the model is "
        "an extrapolation; fit a run that covers it as well"
    )


def _fitted(result: Mapping[str, Any], name: str) -> list[float]:
    """Extreme values of a channel in the training runs; empty if unknown."""
    found: list[float] = []
    runs = result.get("runs")
    for entry in runs if isinstance(runs, Sequence) else ():
        if isinstance(entry, Mapping) and entry.get("role") == "training":
            ranges = entry.get("ranges")
            pair = ranges.get(name) if isinstance(ranges, Mapping) else None
            numbers = [finite(value) for value in pair] if isinstance(pair, list) else []
            found += [number for number in numbers if number is not None]
    return found


def _beyond(name: str, unit: str, values: Array, fitted: Sequence[float]) -> str:
    """Range of a channel beside the fitted one, if it leaves that; else empty."""
    known = values[np.isfinite(values)]
    if not fitted or not known.size:
        return ""
    low, high = min(fitted), max(fitted)
    margin = max(_MARGIN * (high - low), _WARMER if name == "temperature_degC" else 0.0)
    least, most = float(known.min()), float(known.max())
    if least >= low - margin and most <= high + margin:
        return ""
    pairs = ((least, most), (low, high))
    channel = name.split("_", maxsplit=1)[0]
    reached, known_to = (f"{number_text(a, 3)} to {number_text(b, 3)}" for a, b in pairs)
    return f"{channel} {reached} {unit}, fitted {known_to} {unit}"
