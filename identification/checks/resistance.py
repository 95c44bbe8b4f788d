"""Plausibility of the identified temperature coefficient of the resistance and of the heating.

The winding is of copper, alpha 0.0039 1/K, or of aluminium, 0.0040 1/K.  Leads, brushes and the
transistors of a bridge are colder or have a smaller coefficient, so that alpha_Ra is that of copper
times the share of the winding in Ra25.  A voltage that the model lacks, such as a delay or noise of
the voltage sensor, is fitted as a resistance that does not depend on the temperature at all.

The limits are a share of a quarter and one and a half times copper, which a winding whose
temperature rises by half more than the logged one has.

The winding also cannot become hotter than its insulation endures.  A self-heating that requires it
stands for another dependence of the voltage on current or time.

Source: IEC 60034-1 (2022), 8.6.2.3.3 (225 and 235 degC for aluminium and copper, which is
1 / (T + 25 degC) at 25 degC); IEC 60085 (2007), 5 (thermal classes of insulation).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from identification.checks.finding import Finding

__all__ = ["heating_findings", "is_refuted", "resistance_findings"]

_COPPER: Final = 1.0 / 260.0
"""Temperature coefficient of copper at 25 degC [1/K]."""
_LIMITS: Final = (0.25 * _COPPER, 1.5 * _COPPER)
"""Smallest and largest plausible coefficient [1/K]."""
_SPREADS: Final = 3.0
"""Standard deviations by which a coefficient has to exceed its limit."""

_MOST_RISE: Final = 225.0
"""Rise from 25 degC to 250 degC, the highest numbered thermal class [K]."""


def heating_findings(rise: float) -> list[Finding]:
    """Suspicion about a winding that heats beyond what any insulation endures.

    Args:
        rise: Largest rise of the winding by self-heating in the training runs [K].
    """
    if not rise > _MOST_RISE:
        return []
    remedy = (
        "compare the supply, and the zero and gain of the current sensor, at the beginning and the "
        "end of a run"
    )
    return [
        Finding(
            "winding_heating",
            "suspect",
            "",
            None,
            f"the winding would heat by {rise:.0f} K within a run, more than any insulation "
            "endures, so self_heating stands for another effect that depends on current or time; "
            f"{remedy}",
            "temperature rise of the winding [K]",
            rise,
            _MOST_RISE,
            separable=False,
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
        Finding(
            "resistance_coefficient",
            "suspect",
            "",
            None,
            f"alpha_Ra is {value:.3g} 1/K, expected {low:.2g} to {high:.2g} 1/K for a winding of "
            "copper, so Ra25, alpha_Ra and L are not taken as identified; possible causes: a delay "
            "or noise of the voltage sensor, a temperature that is not that of the winding, an "
            f"effect that the model lacks; {remedy}",
            "temperature coefficient [1/K]",
            value,
            low if value < low else high,
            separable=False,
            remedy=remedy,
            option="known",
        )
    ]
