"""Plausibility of units that may be wrong in all runs, by the proportions of typical motors.

Scaling a channel of all runs gives another motor that obeys the same equations.  These checks
therefore refuse no run; they report what to verify.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.checks.consistency import Estimate
from identification.checks.correction import factor, other_unit
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["plausibility_findings"]

_SHEAR_PA: Final = 5e3
_TIP_M_S: Final = 35.0
_FAST_RAD_S: Final = 1500.0
_LIGHT: Final = 0.02
_IRON: Final = 7.5e3
_SLOW_S: Final = 8.0
_COARSE_S: Final = 0.02
_SHORT: Final = 0.15


def plausibility_findings(runs: Sequence[Run], estimates: Sequence[Estimate]) -> list[Finding]:
    """Suspicions about all runs together, from the estimates of those whose balances hold."""
    sound = [e for e in estimates if e.is_sound and e.inertia > 0.0]
    found = _short(runs)
    if not sound:
        return found
    constant = float(np.median([e.constant for e in sound]))
    inertia = float(np.median([e.inertia for e in sound]))
    resistance = float(np.median([e.resistance for e in sound]))
    friction = max(float(np.median([e.friction for e in sound])), 0.0)
    torque = constant * max(_high(e.run.current) for e in sound)
    speed = max(_high(e.run.speed) for e in sound)
    run = sound[0].run
    # Shear stress at the rotor surface, rotor length equal to diameter: torque = 4 pi r^3 stress.
    radius = (torque / (4.0 * math.pi * _SHEAR_PA)) ** (1.0 / 3.0)
    if speed * radius > _TIP_M_S or speed > _FAST_RAD_S:
        found.append(_fast(run, speed, speed * radius, constant))
    least = math.pi * _IRON * radius**5
    if inertia < _LIGHT * least:
        found.append(_light(run, inertia / least))
    slowness = inertia * resistance / (constant**2 + resistance * friction)
    if slowness > _SLOW_S and run.time.size > 1 and sound[0].interval > _COARSE_S:
        found.append(_slow(run, slowness))
    return found


def _high(signal: np.ndarray) -> float:
    """99 % quantile of the magnitude of a signal."""
    return float(np.quantile(np.abs(signal), 0.99))


def _everywhere(run: Run, word: str) -> str:
    return word.removeprefix(f"{run.name}:")


def _fast(run: Run, speed: float, tip: float, constant: float) -> Finding:
    return Finding(
        "suspicious_unit",
        "suspect",
        "",
        "speed_rad_s",
        f"reaches {speed:.4g} rad/s ({speed * 30 / math.pi:.3g} rpm) at a Kt of {constant:.3g} "
        "V s/rad, too fast for a motor of this torque; if the values are in rpm, Kt is 9.55 times "
        "larger (compare Kt = Ke with the data sheet)",
        "estimated surface speed of the rotor [m/s]" if tip > _TIP_M_S else "speed [rad/s]",
        tip if tip > _TIP_M_S else speed,
        _TIP_M_S if tip > _TIP_M_S else _FAST_RAD_S,
        (_everywhere(run, other_unit(run, "speed_rad_s", "rpm")),),
        separable=False,
    )


def _light(run: Run, ratio: float) -> Finding:
    return Finding(
        "suspicious_unit",
        "suspect",
        "",
        "current_A",
        "is too large for the identified inertia: a rotor for this torque has a larger one; if "
        "the values are in mA, Ra and L are 1,000 times larger, and J and b 1,000 times smaller",
        "inertia relative to a typical rotor of this torque",
        ratio,
        _LIGHT,
        (_everywhere(run, factor(run, "current_A", 1e-3)),),
        separable=False,
    )


def _slow(run: Run, slowness: float) -> Finding:
    return Finding(
        "suspicious_unit",
        "suspect",
        "",
        "time_s",
        f"may be in ms: the mechanical time constant is {slowness:.3g} s, as of a motor with a "
        "heavy flywheel",
        "mechanical time constant [s]",
        slowness,
        _SLOW_S,
        (_everywhere(run, factor(run, "time_s", 1e-3)),),
        separable=False,
    )


def _short(runs: Sequence[Run]) -> list[Finding]:
    rows = float(np.median([run.rows for run in runs]))
    return [
        Finding(
            "short_run",
            "suspect",
            run.name,
            None,
            f"has {run.rows} samples, the median of all runs is {rows:.0f}; "
            "check whether the file is complete",
            "number of samples relative to the median",
            run.rows / rows,
            _SHORT,
        )
        for run in runs
        if run.rows < _SHORT * rows
    ]
