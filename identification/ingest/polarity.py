"""Signs that contradict each other: a sensor the wrong way round, or one without a sign.

At steady current the armature obeys

    v = R i + K w,        R > 0, K > 0

so a fit of this line shows a reversed sensor as a negative coefficient.  A sensor that gives
magnitudes only shows in a drive that reverses: the line fits much better once the sign of the
voltage is put in front of that channel.  The inductance is left out; where it matters the line
fits badly either way and nothing is said.  That a channel keeps its sign while the voltage
reverses is no proof by itself: a motor that is braked by reversed voltage turns on for a while.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.ingest.place import Places
from identification.ingest.run import RunWarning

__all__ = ["check_polarity"]

Array = NDArray[np.float64]

_REVERSAL = 0.1
_MUCH_BETTER = 0.25
_MOST_UNEXPLAINED = 0.3
_LEAST_SHARE = 0.2
_MOST_ALIKE = 0.95


def check_polarity(channels: dict[str, Array], places: Places) -> list[RunWarning]:
    """Compare the signs of voltage, current and speed.

    Args:
        channels: Channel name to (n_sample,), in SI units.
        places: Where the samples stand.

    Returns:
        Warnings.
    """
    voltage, current, speed = (channels[n] for n in ("voltage_V", "current_A", "speed_rad_s"))
    if not (np.ptp(voltage) and np.ptp(current) and np.ptp(speed)):
        return []
    unsigned = _unsigned(voltage, current, speed)
    if unsigned:
        return [
            places.warning(
                "unsigned_channel",
                "keeps one sign while the voltage reverses, and fits the voltage only with its "
                "sign put back; log the signed value, a magnitude cannot be identified from",
                name,
            )
            for name in unsigned
        ]
    return _reversed(voltage, current, speed, places)


def _unsigned(voltage: Array, current: Array, speed: Array) -> list[str]:
    """Channels that hold magnitudes."""
    high = float(np.max(np.abs(voltage)))
    if min(float(np.max(voltage)), -float(np.min(voltage))) <= _REVERSAL * high:
        return []
    sign = np.sign(voltage)
    forms = {"current_A": [current], "speed_rad_s": [speed]}
    for form in forms.values():
        if not np.min(form[0]) < -_REVERSAL * np.max(form[0]):
            form.append(sign * form[0])
    fits = {
        (a, b): _fit(voltage, i, w)[2]
        for a, i in enumerate(forms["current_A"])
        for b, w in enumerate(forms["speed_rad_s"])
    }
    best = min(fits, key=lambda form: fits[form])
    if fits[best] > _MUCH_BETTER * fits[0, 0]:
        return []
    return [name for name, with_sign in zip(forms, best, strict=True) if with_sign]


def _reversed(voltage: Array, current: Array, speed: Array, places: Places) -> list[RunWarning]:
    """Channels of which the line through all samples has a negative coefficient."""
    resistance, constant, unexplained = _fit(voltage, current, speed)
    if unexplained > _MOST_UNEXPLAINED or _alike(current, speed) > _MOST_ALIKE:
        return []
    size = _rms(voltage)
    parts = {"current_A": resistance * _rms(current), "speed_rad_s": constant * _rms(speed)}
    return [
        places.warning(
            "opposite_signs",
            "has the opposite sign of what voltage and the other channel ask for; "
            "check the polarity of the three sensors",
            name,
        )
        for name, part in parts.items()
        if part < -_LEAST_SHARE * size
    ]


def _fit(voltage: Array, current: Array, speed: Array) -> tuple[float, float, float]:
    """Least squares of the line: R [ohm], K [V s/rad] and the unexplained share of v squared."""
    ii, iw, ww = (float(a @ b) for a, b in ((current, current), (current, speed), (speed, speed)))
    vi, vw, vv = (float(voltage @ b) for b in (current, speed, voltage))
    determinant = ii * ww - iw * iw
    if not determinant > 1e-9 * ii * ww:
        return 0.0, 0.0, 1.0
    resistance = (vi * ww - vw * iw) / determinant
    constant = (vw * ii - vi * iw) / determinant
    return resistance, constant, max(0.0, 1.0 - (resistance * vi + constant * vw) / vv)


def _alike(first: Array, second: Array) -> float:
    return abs(float(first @ second)) / (float(np.linalg.norm(first) * np.linalg.norm(second)))


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
