"""Candidate spline curves in every signal that varies in a campaign.

The part of each basis function that is collinear with a nominal parameter is removed (a straight
line in speed is viscous friction), so the nominal parameters keep their meaning during the search.
The data cannot attribute that part; `selection.non_identifiable` adds it to the final model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import CampaignScales, Candidate
from identification.model.excitation import Record
from identification.model.term import AbstractTorque, AbstractVoltage, Expression, Signals, Values
from identification.surrogates.collinear import imitated
from identification.surrogates.curve import HEIGHTS, AbstractCurve

__all__ = ["MissingTorque", "MissingVoltage", "sampled"]

_NEAR_ZERO: Final = 0.15
_LOOKED_AT: Final = 500

_TORQUES: Final = (
    ("speed", ""),
    ("current", ""),
    ("position", ""),
    ("temperature", ""),
    ("time", ""),
    ("size of current", "direction"),
    ("temperature", "direction"),
    ("time", "direction"),
    ("time in the run", "direction"),
    ("position", "direction"),
    ("time", "speed"),
    ("time in the run", "speed"),
)
"""Signal and carrier of each torque curve."""

_VOLTAGES: Final = (
    ("current", ""),
    ("speed", ""),
    ("voltage", ""),
    ("temperature", ""),
    ("time", ""),
    ("size of speed", "current"),
    ("time", "current"),
    ("time in the run", "current"),
    ("position", ""),
)
"""Signal and carrier of each voltage curve."""


@dataclass(frozen=True)
class MissingTorque(AbstractCurve, AbstractTorque):
    """Torque that no effect of the catalogue explains, as a curve."""

    equation = "mechanical"
    unit = "N m"

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The torque [N m]."""
        return self.missing(signals, values)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """Every torque curve in a signal that varies."""
        return _curves(cls, scales, scales.torque, _TORQUES)


@dataclass(frozen=True)
class MissingVoltage(AbstractCurve, AbstractVoltage):
    """Voltage that no effect of the catalogue explains, as a curve."""

    equation = "electrical"
    unit = "V"

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The voltage [V]."""
        return self.missing(signals, values)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """Every voltage curve in a signal that varies."""
        return _curves(cls, scales, scales.voltage, _VOLTAGES)


def _curves(
    kind: type[AbstractCurve], scales: CampaignScales, size: float, pairs: Sequence[tuple[str, str]]
) -> list[Candidate]:
    """Curves of one kind, the spline coefficients of each scored together."""
    terms = (_curve(kind, scales, along, carrier, size) for along, carrier in pairs)
    starts = 0.05 * size * np.eye(HEIGHTS)
    return [Candidate(term, starts, joint=HEIGHTS) for term in terms if term is not None]


def _curve(
    kind: type[AbstractCurve], scales: CampaignScales, along: str, carrier: str, size: float
) -> AbstractCurve | None:
    """The curve along a signal, or None if the signal is not logged or hardly varies."""
    if along == "position" and not scales.angle_logged:
        return None
    if along == "temperature" and scales.heated < 5.0:
        return None
    signal = along.removeprefix("size of ")
    logged = {"current": scales.current, "speed": scales.speed, "voltage": scales.voltage}
    zero = _NEAR_ZERO * logged.get(signal, 1.0)
    runs = _lengths(scales.records)
    starts = tuple(float(s) for s in np.concatenate([[0.0], np.cumsum(runs)]))
    if along == "position":
        lower, upper = 0.0, 2 * np.pi
    elif along.startswith("time"):
        lower, upper = 0.0, float(np.sum(runs) if along == "time" else np.max(runs))
    else:
        seen = np.concatenate([_logged(record, signal) for record in scales.records])
        if along.startswith("size of "):
            seen = np.abs(seen)
        drawn = seen if along == "temperature" else np.arcsinh(seen / zero)
        lower, upper = (float(q) for q in np.quantile(drawn, (0.001, 0.999)))
    if not upper > lower:
        return None
    sizes = size, lower, upper, zero, scales.speed, scales.current
    return _without_imitated(kind(along, carrier, *sizes, starts), scales)


def _lengths(records: tuple[Record, ...]) -> Array:
    """Duration of each run up to the last, zero for run numbers that are absent [s]."""
    last = max(record.run for record in records)
    lengths = np.zeros(last + 1)
    for record in records:
        lengths[record.run] = max(lengths[record.run], float(record.time[-1]))
    return lengths


def _logged(record: Record, signal: str) -> Array:
    if signal in ("current", "speed"):
        return record.measured[:, 0 if signal == "current" else 1]
    return record.column(signal)


def _without_imitated(term: AbstractCurve, scales: CampaignScales) -> AbstractCurve:
    """The curve without the part of each basis function that is collinear with current or speed.

    A curve in voltage may be collinear with both, since v is nearly Ra i + Kt w.
    """
    names = ("current", "speed")
    places = [k for k, name in enumerate(names) if {name, "voltage"} & set(term.drivers)]
    if not places:
        return term
    columns, regressors = sampled(term, scales.records)
    shares = np.zeros((HEIGHTS, 2))
    shares[:, places] = imitated(columns, regressors[:, places])
    return replace(term, imitated=tuple((float(a), float(b)) for a, b in shares))


def sampled(term: AbstractCurve, records: Sequence[Record]) -> tuple[Array, Array]:
    """Basis (n_sample, n_coefficient) and regressors of a curve on a subset of the samples.

    The regressors (n_sample, 3) are current, speed and voltage, each over its scale [-].
    """
    columns, regressors = [], []
    for record in records:
        sparse = _every(record, max(record.rows // _LOOKED_AT, 1))
        current, speed = sparse.measured.T
        columns.append(term.columns(sparse, current, speed))
        sizes = (current / term.current, speed / term.speed, sparse.column("voltage") / term.size)
        regressors.append(np.column_stack(sizes))
    return np.concatenate(columns), np.concatenate(regressors)


def _every(record: Record, step: int) -> Record:
    """Every `step`-th sample of a record; its intervals are not valid for simulation."""
    return replace(
        record, time=record.time[::step], inputs=record.inputs[::step],
        measured=record.measured[::step], weight=record.weight[::step], whole=None,
    )  # fmt: skip
