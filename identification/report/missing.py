"""What was missing against its driver, with the effect that was fitted to it.

A voltage or torque is drawn as it is; one that depends on the direction of the motion or of the
current besides another signal is drawn against that signal, positive where it brakes.  An effect
that changes a coefficient is drawn as that change: in each stretch of the driver it is the slope of
the missing voltage against the current (resistance) or the speed (torque constant), or of the
missing torque against the speed (friction).  Effects with a state of their own, and those that
belong to the time of a run, have no curve over a driver and are drawn over time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.localise import Missing
from identification.fit.solve import Fit
from identification.model.term import AbstractCoefficient, AbstractTerm
from identification.report.along import Along
from identification.report.data import MissingTerm
from identification.report.pictured import (
    AGAINST,
    CHANGES,
    UNITS,
    WORDS,
    carrier_of,
    column_of,
    drivers_of,
    has_a_curve,
)

__all__ = ["missing_terms", "unexplained_terms"]

Array = NDArray[np.float64]

_DRIVERS: Final = {
    "current": ("current", "A"),
    "speed": ("speed", "rad/s"),
    "voltage": ("voltage", "V"),
    "temperature": ("temperature", "degC"),
    "position": ("shaft angle within a turn", "rad"),
    "time": ("time in the run", "s"),
    "peak_temperature": ("highest temperature so far", "degC"),
}
_BINS: Final = 80
_LEAST_IN_BIN: Final = 4
_LEAST_WEIGHT: Final = 1e-3


def missing_terms(final: Fit, found: Along) -> list[MissingTerm]:
    """Each effect against its drivers, with what the data say of it.

    Args:
        final: Fit of the final model.
        found: The model along its simulation.
    """
    pictures = []
    for term in final.simulator.model.terms:
        if not has_a_curve(term):
            continue
        for driver in drivers_of(term):
            if isinstance(term, AbstractCoefficient):
                pictures.append(_changed(term, driver, found))
            else:
                pictures.append(_added(term, driver, found))
    return pictures


def unexplained_terms(
    trace: Mapping[str, Any], missing: Sequence[Missing], signals: Mapping[str, Array]
) -> list[MissingTerm]:
    """What an equation lacks against the signal that shows it best, where no effect was fitted.

    Args:
        trace: Entry of the result.
        missing: The missing terms, one a record.
        signals: Each driver at the instants of all missing terms.
    """
    pictures = []
    for column, equation in enumerate(("electrical", "mechanical")):
        if not missing or not trace.get(equation, {}).get("significant"):
            continue
        shares = {k: v["share"] or 0.0 for k, v in trace[equation]["drivers"].items()}
        driver = max(shares, key=lambda name: shares[name])
        series = [m.voltage if column == 0 else m.torque for m in missing]
        name, unit = _DRIVERS[driver]
        pictures.append(
            MissingTerm(
                equation, WORDS[column], UNITS[column], name, unit,
                signals[driver], np.concatenate(series),
            )
        )  # fmt: skip
    return pictures


def _added(term: AbstractTerm, driver: str, found: Along) -> MissingTerm:
    """A voltage or torque against a driver: means over stretches of it."""
    column = column_of(term, found)
    values = _wrapped(driver, found)
    carrier = carrier_of(term)
    turned = -np.sign(found.drivers[carrier]) if carrier else np.ones(values.size)
    words = f"{WORDS[column]} against the {AGAINST[column]}" if carrier else WORDS[column]
    effects = found.effects[term.name][:, :, column] * turned
    bins = _Bins(values)
    curve = _spread([bins.means(effect) for effect in effects])
    missing = found.missing_for(term.name)[:, column] * turned
    known = np.isfinite(missing)
    return _term(
        term, driver, (column, words, UNITS[column]),
        (values[known], missing[known]), (bins.means(values), *curve),
    )  # fmt: skip


def _changed(term: AbstractCoefficient, driver: str, found: Along) -> MissingTerm:
    """A change of a coefficient against a driver: slopes over stretches of it."""
    column, words, unit = CHANGES[term.coefficient]
    against = found.drivers["current" if term.coefficient == "Ra" else "speed"]
    bins = _Bins(_wrapped(driver, found))
    places = bins.means(bins.values)
    effects = found.effects[term.name][:, :, column]
    curve = _spread([-bins.slopes(effect, against) for effect in effects])
    estimate = -bins.slopes(found.missing_for(term.name)[:, column], against)
    known = np.isfinite(estimate)
    drawn = np.isfinite(curve[0])
    return _term(
        term, driver, (column, words, unit),
        (places[known], estimate[known]), (places[drawn], *(line[drawn] for line in curve)),
    )  # fmt: skip


def _term(
    term: AbstractTerm,
    driver: str,
    quantity: tuple[int, str, str],
    dots: tuple[Array, Array],
    curve: tuple[Array, ...],
) -> MissingTerm:
    column, words, unit = quantity
    name, driver_unit = _DRIVERS[driver]
    grid, median, q05, q95 = curve
    return MissingTerm(
        equation=("electrical", "mechanical")[column],
        quantity=words,
        unit=unit,
        driver=name,
        driver_unit=driver_unit,
        driver_values=dots[0],
        estimate=dots[1],
        grid=grid,
        median=median,
        q05=q05,
        q95=q95,
        effect=term.name,
    )


def _wrapped(driver: str, found: Along) -> Array:
    values = found.drivers[driver]
    return np.mod(values, 2 * np.pi) if driver == "position" else values


def _spread(curves: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Median, 5 % and 95 % over draws; NaN where the driver has too few samples."""
    q05, median, q95 = np.quantile(np.array(curves), (0.05, 0.5, 0.95), axis=0)
    return median, q05, q95


class _Bins:
    """Equal stretches of a driver; those with too few samples are left out of every answer."""

    def __init__(self, values: Array) -> None:
        self.values = values
        low, high = float(values.min()), float(values.max())
        width = (high - low) / _BINS or 1.0
        number = np.clip(((values - low) / width).astype(int), 0, _BINS - 1)
        counts = np.bincount(number, minlength=_BINS)
        self._kept = counts >= min(_LEAST_IN_BIN, values.size)
        self._number = number

    def sums(self, values: Array) -> Array:
        """Sums (n_bin,) of values over each stretch."""
        return np.asarray(np.bincount(self._number, values, _BINS)[self._kept], dtype=np.float64)

    def means(self, values: Array) -> Array:
        """Means (n_bin,) of values over each stretch."""
        return self.sums(values) / self.sums(np.ones_like(values))

    def slopes(self, values: Array, against: Array) -> Array:
        """Slopes (n_bin,) through the origin, NaN where `against` hardly moves."""
        squares = self.sums(against**2)
        weak = squares < _LEAST_WEIGHT * squares.max(initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(weak, np.nan, self.sums(values * against) / squares)
