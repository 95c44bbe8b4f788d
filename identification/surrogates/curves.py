"""Candidate spline curves in every signal that varies in a campaign.

The part of each basis function that is collinear with a nominal parameter is removed (a straight
line in speed is viscous friction), so the nominal parameters keep their meaning during the search.
The data cannot attribute that part; `gauge` adds it to the final model as non-identifiable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import CampaignScales, Candidate
from identification.model.excitation import Record
from identification.surrogates.curve import HEIGHTS, MissingTorque, MissingVoltage
from identification.surrogates.imitation import imitated

__all__ = ["curves", "sampled"]

Array = NDArray[np.float64]

_NEAR_ZERO: Final = 0.15
_LOOKED_AT: Final = 500

_CURVES: Final = {
    "mechanical": (
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
    ),
    "electrical": (
        ("current", ""),
        ("speed", ""),
        ("voltage", ""),
        ("temperature", ""),
        ("time", ""),
        ("size of speed", "current"),
        ("time", "current"),
        ("time in the run", "current"),
        ("position", ""),
    ),
}
"""Signal and carrier of each curve, by equation."""

_KINDS: Final[dict[str, Any]] = {"mechanical": MissingTorque, "electrical": MissingVoltage}


def curves(scales: CampaignScales) -> list[Candidate]:
    """Every curve in a signal that varies, its spline coefficients scored together."""
    found = []
    for equation, pairs in _CURVES.items():
        size = scales.torque if equation == "mechanical" else scales.voltage
        for along, carrier in pairs:
            term = _curve(scales, equation, along, carrier, size)
            if term is not None:
                starts = 0.05 * size * np.eye(HEIGHTS)
                found.append(Candidate(term, starts, joint=HEIGHTS))
    return found


def _curve(
    scales: CampaignScales, equation: str, along: str, carrier: str, size: float
) -> MissingTorque | MissingVoltage | None:
    """The curve along a signal, or None if the signal is not logged or hardly varies."""
    if along == "position" and not scales.angle_logged:
        return None
    if along == "temperature" and scales.heated < 5.0:
        return None
    signal = along.removeprefix("size of ")
    zero = _NEAR_ZERO * float(getattr(scales, signal, 0.0) or 1.0)
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
    term = _KINDS[equation](
        along, carrier, size, lower, upper, zero, scales.speed, scales.current, starts
    )
    curve: MissingTorque | MissingVoltage = _without_imitated(term, scales)
    return curve


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


def _without_imitated(term: Any, scales: CampaignScales) -> Any:
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


def sampled(term: MissingTorque | MissingVoltage, records: Sequence[Record]) -> tuple[Array, Array]:
    """Basis and regressors of a curve on a subset of the samples.

    Args:
        term: The curve.
        records: The records.

    Returns:
        (n_sample, n_coefficient) basis functions, and (n_sample, 3) current, speed and voltage,
        each over its scale [-].
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
        record,
        time=record.time[::step],
        inputs=record.inputs[::step],
        measured=record.measured[::step],
        weight=record.weight[::step],
        whole=None,
    )
