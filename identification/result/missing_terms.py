"""Plot data of the missing voltage or torque, with the fitted effect: by driver and over time.

A voltage or torque is plotted as it is.  If one of its two drivers only gives its sign (the
direction of motion or of current), it is plotted against the other driver, positive where it
opposes that direction.

A change of a coefficient is plotted as that change, estimated in each bin of the driver as a
regression slope: of the missing voltage on the current (resistance) or the speed (torque constant),
or of the missing torque on the speed (friction).

An effect with states of its own or a dependence on time is not a function of a driver.  Over time,
each equation is plotted with the sum of its effects, in the run where they are strongest.

Against a driver, the missing terms are those of a model that keeps the effects that change L or J
(`partial_residuals.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from identification.arrays import Array, Index, evenly
from identification.diagnosis.localise import Missing
from identification.effects.effect import AbstractEffect, effects_of
from identification.model.term import (
    AbstractCoefficient,
    AbstractTerm,
    AbstractTorque,
    AbstractVoltage,
)
from identification.result.effect_texts import effect_words
from identification.result.partial_residuals import FinalPath, PathSamples
from identification.result.report_data import MissingTerm, MissingTrace

__all__ = ["missing_terms", "missing_traces", "undrawn_sentence", "unexplained_terms"]

_EQUATIONS: Final = ("electrical", "mechanical")
_UNITS: Final = ("V", "N m")
"""Units of the missing terms: column 0 is the electrical equation, column 1 the mechanical one."""

_WORDS: Final = ("missing voltage", "missing torque")
_AGAINST: Final = ("current", "motion")
"""Direction that a positive missing voltage or torque opposes, for the axis label."""

_CHANGES: Final = {
    "Ra": (0, "change of Ra", "ohm"),
    "Kt": (0, "change of Kt", "N m/A"),
    "b": (1, "change of b", "N m s/rad"),
}
"""Coefficients whose change is plotted: column of the equation, axis label and unit.  A change of L
shows only in the few samples after a voltage step, too few for the smoother."""
_DRIVERS: Final = {
    "current": ("current", "A"),
    "speed": ("speed", "rad/s"),
    "voltage": ("voltage", "V"),
    "temperature": ("temperature", "degC"),
    "position": ("shaft angle within a turn", "rad"),
    "time": ("time in the run", "s"),
    "peak_temperature": ("highest temperature so far", "degC"),
}
_Q95: Final = 1.6449
_TIMES: Final = 1200
_SWINGS: Final = 24.0
_LEAST_DRAWN: Final = 100
_BINS: Final = 80
_LEAST_IN_BIN: Final = 4
_LEAST_WEIGHT: Final = 1e-3


def missing_terms(path: FinalPath) -> list[MissingTerm]:
    """Plot data of each effect against its drivers, with its estimate from the data."""
    terms = path.final.simulator.model.terms
    drawn = [term for term in effects_of(terms) if _is_static(term)]
    if not drawn:
        return []
    # The voltage or torque of these is in proportion to di/dt or dw/dt.
    changes = [term for term in terms if isinstance(term, AbstractCoefficient)]
    steep = {term.name for term in changes if term.coefficient in ("L", "J")}
    found = path.keeping({*path.kept, *steep}).everywhere
    plots = []
    for term in drawn:
        for driver in _drivers_of(term):
            if isinstance(term, AbstractCoefficient):
                plots.append(_changed(term, driver, found))
            else:
                plots.append(_added(term, driver, found))
    return plots


def unexplained_terms(
    trace: Mapping[str, Any], missing: Sequence[Missing], signals: Mapping[str, Array]
) -> list[MissingTerm]:
    """Plot data of significant missing terms against their best driver, without an effect."""
    plots = []
    for column, equation in enumerate(_EQUATIONS):
        if not missing or not trace.get(equation, {}).get("significant"):
            continue
        shares = {k: v["share"] or 0.0 for k, v in trace[equation]["drivers"].items()}
        driver = max(shares, key=lambda name: shares[name])
        series = [m.voltage if column == 0 else m.torque for m in missing]
        plots.append(
            MissingTerm(
                equation, _WORDS[column], _UNITS[column], *_DRIVERS[driver],
                signals[driver], np.concatenate(series),
            )
        )  # fmt: skip
    return plots


def missing_traces(path: FinalPath, names: Sequence[str]) -> list[MissingTrace]:
    """Plot data for each equation with an effect: a section of the run where it is strongest."""
    in_motor = [term for term in path.final.simulator.model.terms if term.equation != "sensor"]
    if not in_motor:
        return []
    found, plots = path.everywhere, []
    for column in range(2):
        acting = [term for term in in_motor if column == _column_of(term, found)]
        if acting:
            plots.append(_over_time(acting, column, path, found, names))
    return plots


def _added(term: AbstractTerm, driver: str, found: PathSamples) -> MissingTerm:
    """Voltage or torque against a driver: bin means."""
    column = _column_of(term, found)
    values = _wrapped(driver, found)
    carrier = _carrier_of(term)
    turned = -np.sign(found.drivers[carrier]) if carrier else np.ones(values.size)
    words = f"{_WORDS[column]} opposing the {_AGAINST[column]}" if carrier else _WORDS[column]
    effects = found.effects[term.name][:, :, column] * turned
    bins = _Bins(values, divided=True)
    curve = _spread([bins.means(effect) for effect in effects])
    missing = found.missing_for(term.name)[:, column] * turned
    known = np.isfinite(missing)
    return MissingTerm(
        _EQUATIONS[column], words, _UNITS[column], *_DRIVERS[driver],
        values[known], missing[known], bins.means(values), *curve, term.name,
    )  # fmt: skip


def _changed(term: AbstractCoefficient, driver: str, found: PathSamples) -> MissingTerm:
    """Change of a coefficient against a driver: regression slopes in bins."""
    column, words, unit = _CHANGES[term.coefficient]
    against = found.drivers["current" if term.coefficient == "Ra" else "speed"]
    bins = _Bins(_wrapped(driver, found))
    places = bins.means(bins.values)
    effects = found.effects[term.name][:, :, column]
    curve = _spread([-bins.slopes(effect, against) for effect in effects])
    estimate = -bins.slopes(found.missing_for(term.name)[:, column], against)
    known = np.isfinite(estimate)
    drawn = np.isfinite(curve[0])
    median, q05, q95 = (line[drawn] for line in curve)
    return MissingTerm(
        _EQUATIONS[column], words, unit, *_DRIVERS[driver],
        places[known], estimate[known], places[drawn], median, q05, q95, term.name,
    )  # fmt: skip


def _wrapped(driver: str, found: PathSamples) -> Array:
    values = found.drivers[driver]
    return np.mod(values, 2 * np.pi) if driver == "position" else values


def _spread(curves: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Median, 5 % and 95 % quantiles over the draws; NaN in bins without a slope."""
    q05, median, q95 = np.quantile(np.array(curves), (0.05, 0.5, 0.95), axis=0)
    return median, q05, q95


def _over_time(
    terms: Sequence[AbstractTerm],
    column: int,
    path: FinalPath,
    found: PathSamples,
    names: Sequence[str],
) -> MissingTrace:
    """Estimated and fitted sum of these effects over time, in the record where it is strongest."""
    everywhere = _together(terms, column, found)[0]
    records = np.unique(found.record)
    power = [float(np.mean(everywhere[found.record == k] ** 2)) for k in records]
    chosen = int(records[int(np.argmax(power))])
    size = path.final.simulator.records[chosen].rows - 1
    whole = path.within(chosen, evenly(size, _TIMES))
    here = path.within(chosen, _telling(_together(terms, column, whole)[0], size))
    effects = _together(terms, column, here)
    missing, sd = here.missing[:, column], _Q95 * here.missing_sd[:, column]
    return MissingTrace(
        run=names[chosen],
        quantity=_WORDS[column],
        unit=_UNITS[column],
        time=here.time,
        median=missing,
        q05=missing - sd,
        q95=missing + sd,
        fitted=np.median(effects, axis=0),
        effect=" and ".join(term.name for term in terms),
    )


def _together(terms: Sequence[AbstractTerm], column: int, found: PathSamples) -> Array:
    """(n_draw, n_sample) sum of effects."""
    return np.asarray(np.sum([found.effects[term.name][:, :, column] for term in terms], axis=0))


def _telling(effect: Array, size: int) -> Index:
    """Sample indices to plot: the whole record, or a section that resolves single oscillations.

    The effect is (n_point,) at points spread over the record, `size` its number of samples.
    """
    swings = float(np.abs(np.diff(effect)).sum()) / (float(np.ptp(effect)) or 1.0)
    length = int(size * min(1.0, _SWINGS / max(swings, 1e-9)))
    length = max(length, min(size, _LEAST_DRAWN))
    begin = (size - length) // 3
    return np.unique(np.linspace(begin, begin + length - 1, min(length, _TIMES)).astype(int))


class _Bins:
    """Equal-width bins of a driver; bins with too few samples are left out of all results.

    `divided` divides them further where samples are dense, so that a step at zero stays steep.
    """

    def __init__(self, values: Array, *, divided: bool = False) -> None:
        self.values = values
        edges = np.linspace(values.min(), values.max(), _BINS + 1)
        if divided:
            dense = np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1))
            edges = np.union1d(edges, dense)
        number = np.searchsorted(edges[1:-1], values, side="right")
        self._size = edges.size - 1
        counts = np.bincount(number, minlength=self._size)
        self._kept = counts >= min(_LEAST_IN_BIN, values.size)
        self._number = number

    def sums(self, values: Array) -> Array:
        """Sums (n_bin,) of values in each bin."""
        return np.asarray(
            np.bincount(self._number, values, self._size)[self._kept], dtype=np.float64
        )

    def means(self, values: Array) -> Array:
        """Means (n_bin,) of values in each bin."""
        return self.sums(values) / self.sums(np.ones_like(values))

    def slopes(self, values: Array, against: Array) -> Array:
        """Regression slopes (n_bin,) through the origin; NaN where `against` is close to zero."""
        squares = self.sums(against**2)
        weak = squares < _LEAST_WEIGHT * squares.max(initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(weak, np.nan, self.sums(values * against) / squares)


def undrawn_sentence(terms: Sequence[AbstractTerm]) -> str:
    """Report sentence on the effects that cannot be plotted; empty if all can."""
    names = [effect_words(term.name) for term in terms if term.equation == "sensor"]
    if not names:
        return ""
    verb = "acts" if len(names) == 1 else "act"
    return (
        f"{' and '.join(names).capitalize()} {verb} on the logged signals and "
        "not in the motor, so there is no missing voltage or torque to plot."
    )


def _is_static(term: AbstractEffect) -> bool:
    """True for an effect in the motor that depends on its drivers alone, and not on time."""
    changes = isinstance(term, AbstractCoefficient) and term.coefficient in _CHANGES
    plain = isinstance(term, AbstractTorque | AbstractVoltage) or changes
    in_motor = term.equation != "sensor"
    return in_motor and plain and not term.states and "time" not in _drivers_of(term)


def _drivers_of(term: AbstractEffect) -> tuple[str, ...]:
    """Drivers to plot the effect against; a constant effect is plotted against the speed."""
    carrier = _carrier_of(term)
    return tuple(name for name in term.plotted[:2] if name != carrier) or ("speed",)


def _carrier_of(term: AbstractTerm) -> str:
    """Driver that only gives an effect of two drivers its sign; empty if there is none."""
    carrier = "speed" if term.equation == "mechanical" else "current"
    plain = isinstance(term, AbstractTorque | AbstractVoltage)
    return carrier if plain and len(term.drivers) == 2 and carrier in term.drivers else ""


def _column_of(term: AbstractTerm, found: PathSamples) -> int:
    """Column of the equation in which an effect is plotted: 0 electrical, 1 mechanical."""
    if isinstance(term, AbstractTorque):
        return 1
    if isinstance(term, AbstractCoefficient) and term.coefficient in ("b", "J"):
        return 1
    if term.equation == "mechanical":
        return 1 if np.any(found.effects[term.name][0, :, 1]) else 0
    return 0
