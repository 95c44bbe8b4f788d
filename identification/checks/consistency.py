"""Consistency of runs with each other: wrong scale factors, runs of another motor.

Scaling voltage, current, speed and time by factors gives another motor that obeys the same
balances, so a single run cannot reveal a wrong scale.  Runs of one motor agree in resistance,
torque constant and inertia, except for temperature and effects.  A factor of 9.55 or 1,000 is not
an effect.

If friction keeps current and speed in proportion, a run determines neither R nor K, but

    voltage per current   G = R + K^2 / b        voltage per speed   H = G b / K

and the mechanical time constant J / b.  Another load changes G, H and J / b.  A wrong scale or sign
of a channel leaves J / b as it is and scales G and H by factors that name the channel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median_low
from typing import Final

import numpy as np

from identification.checks.balance import signals_of
from identification.checks.finding import Finding, factor, refusal
from identification.ingest.run import Run

__all__ = ["Estimate", "consistency_findings", "estimate_of", "scale_of"]

_COPPER: Final = 0.0039
_MAGNET: Final = -0.0010
_REFERENCE: Final = 25.0
_CLEAN: Final = 0.02
"""Unexplained fraction of the voltage up to which a run's coefficients are used."""
_ERRORS: Final = 5.0
_CONSTANT: Final = math.log(1.35)
"""Largest deviation of ln K between runs.  Of 1,680 healthy runs with and without effects 99 % are
within 9 % of the median; late demagnetisation and saturation reach 25 %."""
_RESISTANCE: Final = math.log(2.5)
"""Largest deviation of ln R between runs.  Temperature, brushes and lost voltage change R more than
K, up to a factor 1.7."""
_MANY_WINDOWS: Final = 60
_FEW_WINDOWS: Final = 3.0
"""Factor on both limits for runs with so few windows that their standard errors are uncertain."""
_NAMED: Final = math.log(1.35)
_NAMED_RESISTANCE: Final = math.log(1.6)
_TIME: Final = math.log(1.6)

_COEFFICIENTS: Final = (("Kt", "V s/rad"), ("Ra", "ohm"))
_GAINS: Final = (("voltage per speed", "V s/rad"), ("voltage per current", "V/A"))

_SCALES: Final = (
    ("speed_rad_s", 60.0 / (2.0 * math.pi), "rpm"),
    ("speed_rad_s", 180.0 / math.pi, "degrees per second"),
    ("speed_rad_s", 2.0 * math.pi, ""),
    ("current_A", 1e3, "mA"),
    ("voltage_V", 1e3, "mV"),
    *(
        (name, size, "")
        for size in (1e3, 100.0, 1e4, 1e6)
        for name in ("voltage_V", "current_A", "speed_rad_s")
    ),
)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Regression coefficients of one run; equal to itself only, as a file may be given twice."""

    run: Run
    resistance: float
    """At 25 degC with the coefficient of copper [ohm]."""
    resistance_error: float
    """Its relative standard error."""
    raw_resistance: float
    """At the run's own temperature [ohm]."""
    constant: float
    """Torque constant at 25 degC with the coefficient of a typical magnet [V s/rad]."""
    constant_error: float
    """Its relative standard error."""
    inertia: float
    """[kg m^2]."""
    inertia_error: float
    """Its relative standard error."""
    interval: float
    """Median sample interval [s]."""
    missed: float
    """Unexplained fraction of the voltage."""
    friction: float
    """Viscous friction of the same regression [N m s/rad]."""
    windows: int
    """Number of windows of that regression."""
    ohmic: float
    """RMS voltage across the resistance over the RMS voltage, means subtracted."""
    proportion: tuple[float, float, float] | None
    """`Balance.proportion` at 25 degC, if the winding has most of the voltage."""

    @property
    def is_long(self) -> bool:
        """True if there are enough windows to trust the standard errors."""
        return self.windows >= _MANY_WINDOWS

    @property
    def is_sound(self) -> bool:
        """True if the balances hold well enough to compare the coefficients."""
        return (
            self.missed < _CLEAN
            and self.resistance > 0.0
            and self.constant > 0.0
            and max(self.resistance_error, self.constant_error) < 1.0 / _ERRORS
        )


def estimate_of(run: Run) -> Estimate | None:
    """Coefficients of a run; None if it is too short or its signals are constant."""
    balances = signals_of(run).balances
    fits = [(e, m, b) for b in balances if (e := b.electrical) and (m := b.mechanical)]
    if not fits:
        return None
    e, m, best = min(fits, key=lambda fit: fit[0].missed)
    warmth = 0.0 if run.temperature is None else float(np.mean(run.temperature)) - _REFERENCE
    resistance, constant, inertia = e.values[0], e.values[1], m.values[0] * e.values[1]
    ratios = best.proportion(_CLEAN, 1.0 / _ERRORS)
    copper, magnet = (max(1.0 + alpha * warmth, 0.1) for alpha in (_COPPER, _MAGNET))
    return Estimate(
        run,
        float(resistance / copper),
        _relative(e.errors[0], resistance),
        float(resistance),
        float(constant / magnet),
        _relative(e.errors[1], constant),
        float(inertia),
        _relative(m.errors[0], m.values[0]),
        float(np.median(np.diff(run.time))),
        e.missed,
        float(m.values[1] * constant),
        best.voltage.size,
        float(e.shares[0]),
        None if ratios is None else (ratios[0] / copper, ratios[1] * magnet / copper, ratios[2]),
    )


def _relative(error: float, value: float) -> float:
    return float(error / abs(value)) if value else math.inf


def consistency_findings(estimates: Sequence[Estimate]) -> list[Finding]:
    """Findings for runs, all with correct signs, whose coefficients contradict the others."""
    found = _proportion_findings([e for e in estimates if e.proportion])
    named = {f.file for f in found}
    sound = [e for e in estimates if e.is_sound and e.run.name not in named]
    return found + (_sound_findings(sound) if len(sound) > 1 else [])


def _sound_findings(sound: Sequence[Estimate]) -> list[Finding]:
    centre = median_low(e.constant for e in sound), median_low(e.resistance for e in sound)
    odd = [e for e in sound if _is_odd(e, *centre)]
    if 2 * len(odd) >= len(sound):
        return [_divided({e: (e.constant, e.resistance) for e in sound}, _COEFFICIENTS)]
    fitting = [e for e in sound if e not in odd]
    late = [(e, ratio) for e in fitting if (ratio := _time_ratio(e, sound)) is not None]
    return [_odd_finding(e, fitting) for e in odd] + [_time_finding(e, r, sound) for e, r in late]


def _proportion_findings(alike: Sequence[Estimate]) -> list[Finding]:
    """Findings for runs with current and speed in proportion, of which a majority agrees."""
    known = np.array([e.proportion for e in alike]).reshape(-1, 3)
    usual = np.array([median_low(column) for column in known.T.tolist()]) if alike else known
    found = []
    for e, ratios in zip(alike, known / usual, strict=True):
        gain, constant, time = ratios.tolist()
        if abs(math.log(abs(time))) > _TIME or time < 0.0:
            continue
        named = scale_of(abs(constant), abs(gain))
        if named is not None:
            found.append(_scale_finding(e, *named, ratio=constant))
        elif min(gain, constant) < 0.0:
            found.append(_sign_finding(e, gain, constant))
    if 2 * len(found) < len(alike) or not found:
        return found
    gains = {e: (abs(e.proportion[1]), abs(e.proportion[0])) for e in alike if e.proportion}
    return [_divided(gains, _GAINS, [f for f in found if f.code == "reversed_channel"])]


def _sign_finding(e: Estimate, gain: float, constant: float) -> Finding:
    """Finding for a channel that has the opposite sign of that in the other runs."""
    channel = "speed_rad_s" if gain > 0.0 else "current_A" if constant > 0.0 else "voltage_V"
    word, value = ("current", gain) if gain < 0.0 else ("speed", constant)
    return refusal(
        "reversed_channel",
        e.run,
        channel,
        "has the wrong sign: voltage, current and speed have other signs relative to each other "
        "than in the other runs",
        (f"voltage per {word} relative to the other runs", value, 0.0),
        factor(e.run, channel, -1.0),
    )


def _is_odd(e: Estimate, constant: float, resistance: float) -> bool:
    wide = 1.0 if e.is_long else _FEW_WINDOWS
    far = abs(math.log(e.constant / constant))
    if far > max(wide * _CONSTANT, _ERRORS * e.constant_error):
        return True
    if any(w.code == "unknown_gain" for w in e.run.warnings):
        return False
    far = abs(math.log(e.resistance / resistance))
    return far > max(wide * _RESISTANCE, _ERRORS * e.resistance_error)


def _odd_finding(e: Estimate, fitting: Sequence[Estimate]) -> Finding:
    constant = median_low(f.constant for f in fitting)
    resistance = median_low(f.resistance for f in fitting)
    named = scale_of(e.constant / constant, e.resistance / resistance)
    if named is not None:
        return _scale_finding(e, *named, ratio=e.constant / constant)
    far_constant = abs(math.log(e.constant / constant)) > _CONSTANT
    name, unit, value, usual, limit = (
        ("Kt", "V s/rad", e.constant, constant, _CONSTANT)
        if far_constant
        else ("Ra", "ohm", e.resistance, resistance, _RESISTANCE)
    )
    ratio, limit = value / usual, math.exp(limit if value > usual else -limit)
    return refusal(
        "foreign_motor",
        e.run,
        None,
        f"another motor or a wrong channel scale: {name} is {value:.3g} {unit} in this run and "
        f"{usual:.3g} {unit} in the other runs; omit the run, or correct the scale",
        (f"{name} relative to the other runs", ratio, limit),
    )


def scale_of(constant: float, resistance: float) -> tuple[str, float, str] | None:
    """Channel, factor on its values, and unit that explain Kt and Ra relative to the usual ones."""
    at = math.log(constant), math.log(resistance)
    for channel, size, unit in _SCALES:
        for s, word in ((size, unit), (1.0 / size, "")):
            step = math.log(s)
            expected = {
                "voltage_V": (step, step),
                "current_A": (0.0, -step),
                "speed_rad_s": (-step, 0.0),
            }[channel]
            if abs(at[0] - expected[0]) < _NAMED and abs(at[1] - expected[1]) < _NAMED_RESISTANCE:
                return channel, s, word
    return None


def _scale_finding(e: Estimate, channel: str, s: float, unit: str, *, ratio: float) -> Finding:
    """Finding for a wrong scale; `ratio` is Kt, or voltage per speed, over the usual one."""
    kind = f"; the values are probably in {unit}" if unit else ""
    statistic, value, limit = "scale factor", s, math.exp(_RESISTANCE)
    if channel != "current_A":
        statistic, value = "Kt relative to the other runs", ratio
        limit = math.exp(math.copysign(_CONSTANT, math.log(abs(value))))
    return refusal(
        "scaled_channel",
        e.run,
        channel,
        f"the values are {s:.4g} times those expected from the other runs{kind}",
        (statistic, value, limit),
        factor(e.run, channel, 1.0 / s),
    )


def _divided(
    values: Mapping[Estimate, tuple[float, float]],
    words: tuple[tuple[str, str], tuple[str, str]],
    reversed_: Sequence[Finding] = (),
) -> Finding:
    """Finding for runs in groups without a majority; their values scale as Kt and Ra.

    `words` are names and units of the values, `reversed_` findings of signs unlike the others.
    """
    ratios = [max(each) / min(each) for each in zip(*values.values(), strict=True)]
    k = 0 if ratios[0] >= math.exp(_CONSTANT) else 1
    low, high = (chosen(values, key=lambda e: values[e][k]) for chosen in (min, max))
    corrections: list[str] = []
    hint = "use runs of one motor, recorded in the same units"
    if reversed_:
        low = next(e for e in values if e.run.name == reversed_[0].file)
        high = next(e for e in values if e.run.name not in {f.file for f in reversed_})
        hint = f"{reversed_[0].column} has opposite signs in them"
    for one, other in ((low, high), (high, low)):
        named = scale_of(*(a / b for a, b in zip(values[one], values[other], strict=True)))
        # A forgotten unit is usually a small one, so that the numbers are too large.
        if named is not None and named[1] > 1.0:
            corrections.append(factor(one.run, named[0], 1.0 / named[1]))
            hint = f"{named[0]} of {one.run.name} may be in {named[2] or 'another unit'}"
            break

    def described(e: Estimate) -> str:
        each = zip(words, values[e], strict=True)
        return f"{e.run.name} ({', '.join(f'{n} {value:.3g} {u}' for (n, u), value in each)})"

    return Finding(
        "contradicting_runs",
        "refuse",
        "",
        None,
        f"{described(low)} and {described(high)} contradict each other, and no majority of the "
        f"runs decides between them; {hint}",
        f"ratio of the largest {words[0][0]} to the smallest",
        ratios[0],
        math.exp(_CONSTANT),
        tuple(corrections),
    )


def _time_ratio(e: Estimate, sound: Sequence[Estimate]) -> float | None:
    """Factor of interval and inertia if the time of a run has another unit."""
    others = [o for o in sound if o is not e and o.inertia > 0.0]
    if not others or not e.inertia > 0.0 or not e.inertia_error < 1.0 / _ERRORS:
        return None
    interval = e.interval / median_low(o.interval for o in others)
    inertia = e.inertia / median_low(o.inertia for o in others)
    for ratio in (1e3, 1e6, 1e9, 60.0):
        if abs(math.log(interval / ratio)) < _TIME and abs(math.log(inertia / ratio)) < 2.0 * _TIME:
            return ratio
    return None


def _time_finding(e: Estimate, ratio: float, sound: Sequence[Estimate]) -> Finding:
    unit = {1e3: "ms", 1e6: "us", 1e9: "ns"}.get(ratio, "another unit")
    relative = e.interval / median_low(o.interval for o in sound if o is not e)
    return refusal(
        "scaled_channel",
        e.run,
        "time_s",
        f"the values are {ratio:g} times too large, probably in {unit}: sample interval and "
        "inertia exceed those of the other runs by this factor",
        ("sample interval relative to the other runs", relative, ratio / math.exp(_TIME)),
        factor(e.run, "time_s", 1.0 / ratio),
    )
