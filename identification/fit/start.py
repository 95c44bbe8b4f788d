"""Starting values from the runs, by regression with state-variable filters.

Both balances are linear in their coefficients if derivatives are replaced by filtered derivatives.
With the same low-pass filter on every signal,

    v_f = Ra i_f + Ra alpha_Ra ((T - 25) i)_f + Kt w_f + Kt alpha_Kt ((T - 25) w)_f + L (di/dt)_f
    (Kt(T) i)_f = J (dw/dt)_f + b w_f + [constant + dry friction]

The best cutoff depends on the noise and on the motor, whose time constants span six decades.
Several cutoffs are therefore tried, and the simulation error selects among their results.  The two
terms in brackets are not in the nominal model; they keep friction from biasing the starting values
of J and b.

Source: Young, Automatica 17 (1981), 23-39 (state-variable filters in the identification of
continuous-time models).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import signal

from identification.arrays import Array
from identification.linear import least_squares
from identification.model.excitation import Record, sample_interval
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["starting_values"]

_CUTOFFS: Final = 8
_LEAST_SPAN_DEGC: Final = 3.0
_TYPICAL: Final = (0.0035, -0.001)
"""Temperature coefficients alpha_Ra and alpha_Kt of usual materials [1/K]."""
_LARGEST_SLOPE: Final = 0.02


def starting_values(records: Sequence[Record]) -> Array:
    """Candidate starting vectors (7, n_candidate), all finite and inside their physical bounds.

    One per filter cutoff and one from signal sizes alone; physical, in the order of the nominal
    parameters.
    """
    interval = sample_interval(records)
    longest = max(float(r.time[-1] - r.time[0]) for r in records)
    lowest = min(6.0 / longest, 0.25 / interval)
    cutoffs = np.geomspace(lowest, 1.0 / interval, _CUTOFFS)
    scales = _scales(records, interval)
    # The regression needs logged temperatures.
    known = [record for record in records if record.expected is None] or records
    found = [_regressed(known, cutoff, interval, scales) for cutoff in cutoffs]
    found.append(scales)
    return np.column_stack(found)


def _scales(records: Sequence[Record], interval: float) -> Array:
    """Starting values from signal sizes alone, for runs too poor for a regression."""

    def size(column: Array) -> float:
        return float(np.sqrt(np.mean(column**2)))

    voltage = size(np.concatenate([r.column("voltage") for r in records]))
    current = size(np.concatenate([r.measured[:, 0] for r in records]))
    speed = size(np.concatenate([r.measured[:, 1] for r in records]))
    voltage = voltage or 1.0
    resistance = 0.3 * voltage / current if current > 0 else 1.0
    constant = 0.7 * voltage / speed if speed > 0 else 0.1
    friction = 0.2 * constant * (current or 1.0) / (speed or 1.0)
    inertia = 50.0 * interval * (friction + constant**2 / resistance)
    inductance = resistance * 2.0 * interval
    alpha_ra, alpha_kt = _TYPICAL
    return np.array([resistance, alpha_ra, constant, alpha_kt, inertia, friction, inductance])


def _regressed(records: Sequence[Record], cutoff: float, interval: float, scales: Array) -> Array:
    rows = [_rows(record, cutoff, interval) for record in records]
    electrical, mechanical = zip(*rows, strict=True)
    v, i, ti, w, tw, di = np.concatenate(electrical).T
    spans = np.concatenate([r.column("temperature") for r in records])
    heated = np.ptp(spans) >= _LEAST_SPAN_DEGC
    columns = [i, w, di, ti, tw] if heated else [i, w, di]
    answer = _least_squares(np.column_stack(columns), v)
    resistance, constant, inductance = answer[:3]
    resistance = _positive(resistance, scales[0])
    constant = _positive(constant, scales[2])
    alpha_ra, alpha_kt = _TYPICAL
    if heated:
        alpha_ra = float(np.clip(answer[3] / resistance, -_LARGEST_SLOPE, _LARGEST_SLOPE))
        alpha_kt = float(np.clip(answer[4] / constant, -_LARGEST_SLOPE, _LARGEST_SLOPE))
    mi, mti, dw, mw, one, dry = np.concatenate(mechanical).T
    torque = constant * (mi + alpha_kt * mti)
    inertia, friction = _least_squares(np.column_stack([dw, mw, one, dry]), torque)[:2]
    inertia = _positive(inertia, scales[4])
    floor = 1e-3 * constant**2 / resistance
    friction = max(float(friction), floor) if np.isfinite(friction) else floor
    inductance = max(float(inductance), 0.05 * resistance * interval)
    return np.array([resistance, alpha_ra, constant, alpha_kt, inertia, friction, inductance])


def _rows(record: Record, cutoff: float, interval: float) -> tuple[Array, Array]:
    """Filtered regressors of one record: electrical (n, 6) and mechanical (n, 6)."""
    heat = record.column("temperature") - REFERENCE_TEMPERATURE_DEGC
    current, speed = record.measured.T
    # Bilinear transforms of c^2/(s + c)^2 and s c^2/(s + c)^2.
    twice = 2.0 / interval
    pole = (cutoff - twice) / (cutoff + twice)
    poles = np.array([1.0, 2.0 * pole, pole**2])
    smooth = (cutoff / (cutoff + twice)) ** 2 * np.array([1.0, 2.0, 1.0])
    rate = twice * (cutoff / (cutoff + twice)) ** 2 * np.array([1.0, 0.0, -1.0])
    settled = np.array([1.0 - smooth[0], smooth[2] - poles[2]])

    def low(x: Array) -> Array:
        return np.asarray(signal.lfilter(smooth, poles, x, zi=settled * x[0])[0])

    def slope(x: Array) -> Array:
        return np.asarray(signal.lfilter(rate, poles, x - x[0]))

    one = np.ones_like(current)
    # Samples closer together than the low-pass filter resolves are redundant.
    skip = min(int(6.0 / (cutoff * interval)), record.rows // 2)
    kept = slice(skip, None, max(1, int(0.3 / (cutoff * interval))))
    i, w, ti = low(current), low(speed), low(heat * current)
    v, tw = low(record.column("voltage")), low(heat * speed)
    electrical = np.column_stack([v, i, ti, w, tw, slope(current)])[kept]
    dry = low(np.sign(np.where(np.abs(w) > 1e-9 * (np.abs(w).max() + 1e-300), w, 0.0)))
    mechanical = np.column_stack([i, ti, slope(speed), w, one, dry])[kept]
    return electrical, mechanical


def _least_squares(columns: Array, target: Array) -> Array:
    size = np.sqrt(np.mean(columns**2, axis=0))
    size[size == 0] = 1.0
    # Normal equations of scaled columns are far cheaper than an orthogonal factorisation of all
    # rows; their squared condition number does no harm to a starting value.
    scaled = columns / size
    answer = least_squares(scaled.T @ scaled, scaled.T @ target, 1e-12)
    return np.asarray(answer / size)


def _positive(value: float, fallback: float) -> float:
    """`value` if it is positive and not far below `fallback`, else `fallback`."""
    return float(value) if np.isfinite(value) and value > 1e-4 * fallback else float(fallback)
