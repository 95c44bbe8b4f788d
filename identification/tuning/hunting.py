"""Limit cycles and stick-slip of the loop around constant references.

With friction that falls with speed (Stribeck), integral action may never come to rest: the shaft
sticks, the integral winds up until it breaks away, overshoots and sticks again.  A linear loop
cannot show this.  The loop is simulated at constant references from the step down to one per cent
of it, for several settling times, and the last half of the response is judged:

    stick-slip    the speed keeps oscillating, and the shaft stands for a fifth of the time
    limit cycle   the speed keeps oscillating
    standstill    the shaft does not turn

Source: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138, section 4
(stick-slip and hunting); Olsson and Astrom, IEEE Trans. Control Systems Technology 9 (2001),
629-636 (friction generated limit cycles).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.tuning.drive import Response, most_samples
from identification.tuning.judge import Judge

__all__ = ["hunting"]

_REFERENCES: Final = (1.0, 0.3, 0.1, 0.03, 0.01)
_DRAWS: Final = 16
_LONGER: Final = 8
_AMPLITUDE: Final = 0.02
"""Least amplitude of an oscillation over the reference [-]."""
_KEPT: Final = 0.7
"""Least ratio of the amplitudes of the last quarter and of the one before."""
_LEAST_CROSSINGS: Final = 6
_STUCK: Final = 0.15
"""Largest speed of a stuck shaft over the mean speed [-]; the friction laws are smoothed."""
_DWELL: Final = 0.2
"""Least fraction of the time that the shaft is stuck [-]."""
_STANDS: Final = 0.02
_KINDS: Final = ("stick-slip", "limit cycle", "standstill")


def hunting(judge: Judge, gains: Array, samples: int) -> list[dict[str, Any]]:
    """References at which the speed, under gains (4,), does not come to rest above zero.

    Returns:
        One entry for each kind of behaviour, reference and temperature at which it occurs: the
        fraction of the draws, and the medians of amplitude and period over these draws.
    """
    ends = sorted({judge.temperatures[0], judge.temperatures[-1]})
    few = judge.of(judge.motor.thinned(_DRAWS), ends)
    count = min(_LONGER * samples, most_samples(judge.specification))
    entries = []
    for share in _REFERENCES:
        reference = share * judge.step
        found = few.responses(gains, count, reference)
        for temperature, response in zip(ends, found, strict=True):
            entries += _entries(response, reference, temperature)
    return entries


def _entries(response: Response, reference: float, temperature: float) -> list[dict[str, Any]]:
    kinds, amplitude, period = _behaviour(response, reference)
    entries = []
    for kind in _KINDS:
        has = kinds == kind
        if not has.any():
            continue
        moves = kind != "standstill"
        entries.append(
            {
                "kind": kind,
                "reference_rad_s": reference,
                "temperature_degC": temperature,
                "probability": float(has.mean()),
                "amplitude_rad_s": float(np.median(amplitude[has])) if moves else None,
                "period_s": float(np.median(period[has])) if moves else None,
            }
        )
    return entries


def _behaviour(response: Response, reference: float) -> tuple[NDArray[np.str_], Array, Array]:
    """Kind (empty if it rests), amplitude [rad/s] and period [s] of each draw."""
    half = response.speed[response.speed.shape[0] // 2 :] / reference
    quarter = half.shape[0] // 2
    before, last = half[:quarter], half[quarter:]
    mean = last.mean(axis=0)
    amplitude, earlier = (0.5 * np.ptp(part, axis=0) for part in (last, before))
    is_above = half > half.mean(axis=0)
    crossings = (is_above[1:] != is_above[:-1]).sum(axis=0)
    oscillates = (
        (amplitude > _AMPLITUDE) & (amplitude > _KEPT * earlier) & (crossings >= _LEAST_CROSSINGS)
    )
    stuck = (np.abs(half) < _STUCK * np.abs(half.mean(axis=0))).mean(axis=0)
    sticks = oscillates & (stuck >= _DWELL)
    stands = ~oscillates & (np.abs(mean) < _STANDS)
    kinds = np.select([sticks, oscillates, stands], _KINDS, default="")
    length = float(response.time[-1] - response.time[half.shape[0]])
    return kinds, amplitude * reference, 2 * length / np.maximum(crossings, 1)
