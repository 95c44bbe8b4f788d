"""Plausibility of units and of identified parameters, by the proportions of typical motors.

Scaling a channel of all runs gives another motor that obeys the same equations.  These checks
therefore refuse no run; they report what to verify.

The time constants are compared with data sheets of brushed motors:

    electrical   L / Ra            [s]
    mechanical   J Ra / Kt^2       [s]

Neither depends on the number of turns.  Data sheets of brushed motors up to the size of the
Faulhaber 3863 CR (200 W, Kt / sqrt(Ra) = 0.05 N m/sqrt(W)) give

    electrical   10 us (0816 SR), 25 us (1331 SR), 280 us (3863 CR), all coreless; 0.63 ms with an
                 iron core (Pittman 9232S003: 4.64 mH, 7.38 ohm)
    mechanical   6.1 to 6.5 ms, 6.3 to 7.1 ms, 4.8 ms and 14.4 ms

and those of printed armatures of 0.1 to 4.5 kW give below 0.15 ms and 2.9 to 20.5 ms.  Large servo
motors have electrical time constants of 8 to 40 ms (Parker MGV420B to MGV950C, of three phases; a
brushed motor with an iron core of that size is assumed to have the same).

The limits include these margins.  Electrical: a factor of eight for small motors, none for the
longest time constant of large ones.  Mechanical: a third of the shortest time constant, and ten
times the longest, which is a load of nine times the rotor inertia.

The size of a rotor follows from its rated torque at a shear stress of 5 kPa.  Its surface moves at
15 to 30 m/s in usual machines and at up to 60 m/s in reinforced ones.  Small rotors stay far below
that, and their speed is compared with that of motors of their Kt / sqrt(Ra) [N m/sqrt(W)]:

    0.0009  Faulhaber 0816 SR, up to 16,000 rpm; coreless motors of this size and below in pagers
            and drones are assumed to reach 5,500 rad/s
    0.0015  Mabuchi RC-260RA-2670, 24,000 rpm
    0.016   BaneBots RS-550 (12 V, 85 A, 0.50 N m), 19,300 rpm
    0.018   VEX 775pro (12 V, 134 A, 0.71 N m), 18,730 rpm; motors of this kind in tools and models
            are assumed to reach 3,000 rad/s, and to have batteries of up to 24 V
    0.061   CIM (12 V, 131 A, 2.41 N m), 5,330 rpm; motors above 0.02 are assumed to reach
            1,500 rad/s

A motor logged in rpm under a name in rad/s seems to have 1 / 9.55 of its constant, and 1 / 91 of
its inertia; its balances, time constants and back-EMF are those of a possible motor.  Below the
limits only the data sheet tells the units apart.

The winding is of copper, alpha 0.0039 1/K, or of aluminium, 0.0040 1/K.  Leads, brushes and the
transistors of a bridge are colder or have a smaller coefficient, so that alpha_Ra is that of copper
times the share of the winding in Ra25.  A voltage that the model lacks, such as a delay or noise of
the voltage sensor, is fitted as a resistance that does not depend on the temperature at all.  The
limits are a share of a quarter and one and a half times copper, which a winding whose temperature
rises by half more than the logged one has.

The winding also cannot become hotter than its insulation endures.  A self-heating that requires it
stands for another dependence of the voltage on current or time.

Sources: data sheets of Faulhaber 0816 SR, 1331 SR and 3863 CR (May 2012), Pittman 9232S003, printed
armature motors B9M4 to BR27MACH, and the Parker MGV manual PVD3627 (August 2011), section 3.1.9;
MIT, 2.007 Motor Information (2008) (RC-260RA-2670); BaneBots M2-RS550-120; VEX Robotics 775pro and
CIM; xdccommutator.com, "Maximum RPM Limits for Mechanical Commutators" (surface speeds); IEC
60034-1 (2022), 8.6.2.3.3 (225 and 235 degC for aluminium and copper, which is 1 / (T + 25 degC)
at 25 degC); IEC 60085 (2007), 5 (thermal classes of insulation).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from identification.checks.consistency import Estimate
from identification.checks.finding import Finding, factor, other_unit, suspicion, suspicious_unit
from identification.ingest.run import Run

__all__ = [
    "heating_findings",
    "is_refuted",
    "longest_electrical",
    "plausibility_findings",
    "resistance_findings",
    "time_constant_findings",
]

_SHEAR_PA: Final = 5e3
_TIP_M_S: Final = 60.0
_FASTEST_RAD_S: Final = ((0.001, 24.0, 5500.0), (0.02, 24.0, 3000.0), (math.inf, math.inf, 1500.0))
"""Largest motor constant Kt / sqrt(Ra) [N m/sqrt(W)], largest back-EMF [V] and highest speed
[rad/s]: of motors for pagers and drones, for tools and models, and of others."""
_LIGHT: Final = 0.02
_IRON: Final = 7.5e3
_SLOW_S: Final = 8.0
_COARSE_S: Final = 0.02
_SHORT: Final = 0.15

_SMALL: Final = 0.05
"""Largest motor constant Kt / sqrt(Ra) of a small motor [N m/sqrt(W)]."""
_ELECTRICAL_S: Final = (5e-3, 40e-3)
"""Longest electrical time constant of a small motor and of any motor [s]."""
_MECHANICAL_S: Final = (1e-3, 0.2)
"""Shortest and longest mechanical time constant [s]."""
_COPPER: Final = 1.0 / 260.0
"""Temperature coefficient of copper at 25 degC [1/K]."""
_LIMITS: Final = (0.25 * _COPPER, 1.5 * _COPPER)
"""Smallest and largest plausible coefficient [1/K]."""
_SPREADS: Final = 3.0
"""Standard deviations by which a coefficient has to exceed its limit."""
_MOST_RISE: Final = 225.0
"""Rise from 25 degC to 250 degC, the highest numbered thermal class [K]."""


def plausibility_findings(runs: Sequence[Run], estimates: Sequence[Estimate]) -> Iterator[Finding]:
    """Suspicions about all runs together, from the estimates of those whose balances hold."""
    yield from _short(runs)
    sound = [e for e in estimates if e.is_sound and e.inertia > 0.0]
    if not sound:
        return
    constant = float(np.median([e.constant for e in sound]))
    inertia = float(np.median([e.inertia for e in sound]))
    resistance = float(np.median([e.resistance for e in sound]))
    friction = max(float(np.median([e.friction for e in sound])), 0.0)
    speed = max(_high(e.run.speed) for e in sound)
    run = sound[0].run
    # The rated torque is limited by heat, that is by the RMS current; starts take many times more.
    radius = _radius(constant * max(float(np.sqrt(np.mean(e.run.current**2))) for e in sound))
    size, voltage = constant / resistance**0.5, constant * speed
    fastest = next(
        most for largest, highest, most in _FASTEST_RAD_S if size <= largest and voltage <= highest
    )
    if speed * radius > _TIP_M_S or speed > fastest:
        yield _fast(run, speed, fastest, speed * radius, constant)
    least = math.pi * _IRON * _radius(constant * max(_high(e.run.current) for e in sound)) ** 5
    if inertia < _LIGHT * least:
        yield suspicious_unit(
            run,
            "current_A",
            "is too large for the identified inertia: a rotor for this torque has a larger one; "
            "if the values are in mA, Ra and L are 1,000 times larger, and J and b 1,000 times "
            "smaller",
            ("inertia relative to a typical rotor of this torque", inertia / least, _LIGHT),
            word=factor(run, "current_A", 1e-3),
        )
    slowness = inertia * resistance / (constant**2 + resistance * friction)
    if slowness > _SLOW_S and sound[0].interval > _COARSE_S:
        yield suspicious_unit(
            run,
            "time_s",
            f"may be in ms: the mechanical time constant is {slowness:.3g} s, as of a motor with a "
            "heavy flywheel",
            ("mechanical time constant [s]", slowness, _SLOW_S),
            word=factor(run, "time_s", 1e-3),
        )


def _radius(torque: float) -> float:
    """Radius of a rotor as long as its diameter [m]: torque = 4 pi r^3 stress [N m]."""
    return math.cbrt(torque / (4.0 * math.pi * _SHEAR_PA))


def _high(signal: np.ndarray) -> float:
    """99 % quantile of the magnitude of a signal."""
    return float(np.quantile(np.abs(signal), 0.99))


def _fast(run: Run, speed: float, fastest: float, tip: float, constant: float) -> Finding:
    measured = "speed [rad/s]", speed, fastest
    verdict = "which few motors of this size reach"
    if tip > _TIP_M_S:
        measured = "estimated surface speed of the rotor [m/s]", tip, _TIP_M_S
        verdict = "too fast for a motor of this torque"
    return suspicious_unit(
        run,
        "speed_rad_s",
        f"reaches {speed:.4g} rad/s ({speed * 30 / math.pi:.0f} rpm) at a Kt of {constant:.3g} "
        f"V s/rad, {verdict}; compare Kt = Ke with the data sheet: if the values are in rpm, Kt is "
        "9.55 times larger",
        measured,
        word=other_unit(run, "speed_rad_s", "rpm"),
    )


def _short(runs: Sequence[Run]) -> Iterator[Finding]:
    rows = float(np.median([run.rows for run in runs]))
    for run in runs:
        if run.rows < _SHORT * rows:
            yield suspicion(
                "short_run",
                run,
                None,
                f"has {run.rows} samples, the median of all runs is {rows:.0f}; "
                "check whether the file is complete",
                ("number of samples relative to the median", run.rows / rows, _SHORT),
            )


def time_constant_findings(
    values: Mapping[str, float], trusted: Mapping[str, bool]
) -> list[Finding]:
    """Suspicions about time constants that motors of this size do not have.

    Parameters that are not trusted, because they are not determined or given by the user, are not
    checked.
    """
    resistance, constant = values["Ra25"], values["Kt25"]
    if not (resistance > 0.0 and constant > 0.0 and trusted["Ra25"] and trusted["Kt25"]):
        return []
    found, longest = [], longest_electrical(values)
    electrical, mechanical = values["L"] / resistance, values["J"] * resistance / constant**2
    if trusted["L"] and electrical > longest:
        remedy = "measure L with an LCR meter and give --known L=VALUE"
        message = (
            f"L / Ra is {_text(electrical)}, expected at most {_text(longest)} for a motor of this "
            "size; possible causes: a filter or delay of the current sensor, a choke in the leads, "
            f"a wrong sample clock; {remedy}"
        )
        measured = "electrical time constant [s]", electrical, longest
        code = "electrical_time_constant"
        found.append(
            suspicion(code, None, "current_A", message, measured, remedy=remedy, option="known")
        )
    shortest, longest = _MECHANICAL_S
    if trusted["J"] and not shortest <= mechanical <= longest:
        remedy = "compare J with the data sheet and give --known J=VALUE"
        is_short = mechanical < shortest
        why = (
            f"expected at least {_text(shortest)} for a rotor without load; possible causes: a "
            "wrong unit, a wrong sample clock, a current that is not in A"
            if is_short
            else f"expected at most {_text(longest)}; possible causes: the inertia of a gear, "
            "flywheel or load, a wrong sample clock"
        )
        message = f"J Ra / Kt² is {_text(mechanical)}, {why}; {remedy}"
        measured = "mechanical time constant [s]", mechanical, shortest if is_short else longest
        code = "mechanical_time_constant"
        found.append(
            suspicion(code, None, "speed_rad_s", message, measured, remedy=remedy, option="known")
        )
    return found


def longest_electrical(values: Mapping[str, float]) -> float:
    """Longest electrical time constant L / Ra of motors of that size [s]."""
    is_small = values["Kt25"] <= _SMALL * max(values["Ra25"], 0.0) ** 0.5
    return _ELECTRICAL_S[0 if is_small else 1]


def _text(time: float) -> str:
    """Time in ms, or in s from one second on."""
    return f"{time:.3g} s" if time >= 1.0 else f"{1e3 * time:.3g} ms"


def heating_findings(rise: float) -> list[Finding]:
    """Suspicion about a winding whose largest rise by self-heating [K] no insulation endures."""
    if not rise > _MOST_RISE:
        return []
    remedy = (
        "compare the supply, and the zero and gain of the current sensor, at the beginning and the "
        "end of a run"
    )
    return [
        suspicion(
            "winding_heating",
            None,
            None,
            f"the winding would heat by {rise:.0f} K within a run, more than any insulation "
            "endures, so self_heating stands for another effect that depends on current or time; "
            f"{remedy}",
            ("temperature rise of the winding [K]", rise, _MOST_RISE),
            remedy=remedy,
        )
    ]


def is_refuted(
    finding: Finding,
    values: Mapping[str, float],
    deviations: Mapping[str, float],
    trusted: Mapping[str, bool],
) -> bool:
    """True if the fit contradicts the suspicion of a temperature in degrees Fahrenheit.

    The suspicion follows from resistances on window means, which a delay of a channel biases; the
    fit models the delay.  Copper on a Fahrenheit scale has a coefficient below its limit.
    """
    name = "alpha_Ra"
    is_about_it = (finding.code, finding.column) == ("suspicious_unit", "temperature_degC")
    least = values[name] - _SPREADS * deviations[name]
    return is_about_it and trusted[name] and least > finding.limit


def resistance_findings(
    values: Mapping[str, float], deviations: Mapping[str, float], trusted: Mapping[str, bool]
) -> list[Finding]:
    """Suspicion about a resistance that does not rise with temperature as copper does.

    The values and deviations are those of the fit; parameters that are not trusted, because they
    are not determined or given by the user, are not checked.
    """
    name = "alpha_Ra"
    value, spread = values[name], _SPREADS * deviations[name]
    low, high = _LIMITS
    if not trusted[name] or low - spread <= value <= high + spread:
        return []
    remedy = "measure Ra25 with an ohmmeter and give --known Ra25=VALUE"
    return [
        suspicion(
            "resistance_coefficient",
            None,
            None,
            f"alpha_Ra is {value:.3g} 1/K, expected {low:.2g} to {high:.2g} 1/K for a winding of "
            "copper, so Ra25, alpha_Ra and L are not taken as identified; possible causes: a delay "
            "or noise of the voltage sensor, a temperature that is not that of the winding, an "
            f"effect that the model lacks; {remedy}",
            ("temperature coefficient [1/K]", value, low if value < low else high),
            remedy=remedy,
            option="known",
        )
    ]
