"""Check of the logged temperature against the winding resistance, itself a thermometer."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.consistency import Estimate
from identification.checks.finding import Finding, left_out, other_unit, refusal, suspicious_unit
from identification.ingest.run import Run

__all__ = ["heat_findings", "jump_findings"]

_COPPER: Final = 0.0039
_REFERENCE: Final = 25.0
_JUMP_K: Final = 25.0
_JUMP_K_S: Final = 50.0
"""Largest rate of a thermometer [K/s].  One in a winding at ten times its rated current follows
about 10 K/s."""
_FAR: Final = 0.1
_TIMES: Final = 4.0
_OHMIC: Final = 0.15
"""Fraction of the voltage across the resistance below which lags and filters bias it by a tenth."""
_FEWEST: Final = 3
_SPAN_K: Final = 30.0
_FAHRENHEIT: Final = (0.0019, 0.0029)
"""Coefficient of copper on a Fahrenheit scale, 0.00245 relative to a reading of 25, with
margins."""
_LINE: Final = 0.03
"""Largest RMS deviation of the resistances from their line over temperature, over Ra25."""
_COPPERS: Final = (0.0035, 0.00415)


def jump_findings(run: Run) -> Iterator[Finding]:
    """Finding for temperature jumps that no thermometer can follow."""
    if run.temperature is None:
        return
    step = np.abs(np.diff(run.temperature))
    # Any change is possible across a gap of the record.
    step[[start - 1 for start, _ in run.segments[1:]]] = 0.0
    rate = step / np.diff(run.time)
    jumps = np.flatnonzero((step > _JUMP_K) & (rate > _JUMP_K_S))
    if jumps.size:
        worst = int(jumps[np.argmax(step[jumps])])
        cause = "the thermometer has a loose contact"
        if jumps.size == 1:
            cause = f"recordings were joined there (then cut the file), or {cause}"
        yield refusal(
            "jumping_temperature",
            run,
            "temperature_degC",
            f"jumps by {step[worst]:.3g} K between two samples at {run.time[worst]:.6g} s "
            f"(number of jumps: {jumps.size}); probably {cause}; "
            "correct the values, or omit the channel",
            ("rate [K/s]", float(rate[worst]), _JUMP_K_S),
            left_out(run, "temperature_degC"),
        )


def heat_findings(estimates: Sequence[Estimate]) -> list[Finding]:
    """Findings for runs whose logged temperature contradicts their resistance.

    The resistance at 25 degC of the other runs, which agree in all else, is the reference.
    """
    sound = [e for e in estimates if e.is_sound and e.is_long and e.run.temperature is not None]
    if len(sound) < _FEWEST:
        return []
    found = [finding for e in sound if (finding := _against(e, sound)) is not None]
    # If several runs deviate, the others are no reference.
    return found if len(found) == 1 else list(_common(sound))


def _against(e: Estimate, sound: Sequence[Estimate]) -> Finding | None:
    """Finding for a run whose resistance at 25 degC is far from those of the others, or None."""
    others = np.log([o.resistance for o in sound if o is not e])
    middle = float(np.median(others))
    spread = float(np.abs(others - middle).max())
    off = math.log(e.resistance) - middle
    limit = max(_FAR, _TIMES * spread, _TIMES * e.resistance_error)
    if abs(off) < limit or e.ohmic < _OHMIC or e.run.temperature is None:
        return None
    logged = float(np.mean(e.run.temperature))
    effective = _REFERENCE + (e.raw_resistance / math.exp(middle) - 1.0) / _COPPER
    fahrenheit = (logged - 32.0) / 1.8
    mended = math.log(e.raw_resistance / (1.0 + _COPPER * (fahrenheit - _REFERENCE))) - middle
    if abs(mended) < min(max(0.03, spread), 0.4 * abs(off)):
        code = "wrong_unit"
        kind = f"the values are probably in degrees Fahrenheit ({fahrenheit:.3g} degC)"
        correction = other_unit(e.run, "temperature_degC", "degF")
    elif np.ptp(e.run.temperature) == 0.0 and all(
        np.ptp(_temperature(o)) > 0.0 for o in sound if o is not e
    ):
        code, kind = "stuck_sensor", "the thermometer is probably stuck"
        correction = left_out(e.run, "temperature_degC")
    else:
        return None
    return refusal(
        code,
        e.run,
        "temperature_degC",
        f"the logged mean is {logged:.4g} degC, but the resistance of this run corresponds to "
        f"{effective:.3g} degC according to the other runs; {kind}",
        ("logarithm of Ra25 relative to the other runs", off, math.copysign(limit, off)),
        correction,
    )


def _temperature(e: Estimate) -> Array:
    """(n_sample,) logged temperature [degC]; a single zero without a log."""
    return np.zeros(1) if e.run.temperature is None else e.run.temperature


def _common(sound: Sequence[Estimate]) -> Iterator[Finding]:
    """Finding for a temperature that may be in degrees Fahrenheit in all runs."""
    logged = np.array([float(np.mean(_temperature(e))) for e in sound])
    raw = np.array([e.raw_resistance for e in sound])
    if np.ptp(logged) < _SPAN_K or logged.max() < 60.0:
        return
    slope, base = np.polyfit(logged - _REFERENCE, raw, 1)
    left = raw - base - slope * (logged - _REFERENCE)
    if np.sqrt(np.mean(left**2)) > _LINE * base or base <= 0.0:
        return
    coefficient = slope / base
    # The same line over degC, with T = 1.8 C + 32.
    celsius = 1.8 * slope / (base + slope * (1.8 * _REFERENCE + 32.0 - _REFERENCE))
    if _FAHRENHEIT[0] < coefficient < _FAHRENHEIT[1] and _COPPERS[0] < celsius < _COPPERS[1]:
        run = sound[0].run
        yield suspicious_unit(
            run,
            "temperature_degC",
            "may be in degrees Fahrenheit in all runs: the temperature coefficient of the "
            f"resistance is {coefficient:.4f} per logged degree (copper: 0.0039 1/K), and "
            f"{celsius:.4f} 1/K if the values are in degrees Fahrenheit",
            ("temperature coefficient of the resistance [1/K]", float(coefficient), _FAHRENHEIT[1]),
            word=other_unit(run, "temperature_degC", "degF"),
        )
