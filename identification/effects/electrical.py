"""Voltages and coefficients of the armature circuit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import casadi as ca

from identification.effects.effect import Candidate, Survey, amplitude, asymmetry, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)

_ROUND: Final = 0.02
"""Share of the drop below which its size is rounded, so that it has a slope everywhere."""
_SMALLEST: Final = 1e-4
"""Current over the knee below which its size is rounded off."""
_STRAIGHT: Final = 1e-6
"""Power of the current over the knee below which the drop is taken from its series."""

__all__ = ["BrushDrop", "FluxSaturation", "InductanceSaturation"]


@dataclass(frozen=True)
class BrushDrop(AbstractVoltage):
    """Voltage lost at the brush contacts, with the sign of the current.

        v = -V_b (s + a |s|),   |s|^p = 1 - (1 + o |i / i_b|^p)^(-1/o)      [V]

    with s of the sign of i.  `i_b` is where the knee lies: far below the current the drop is a
    step, near it a contact whose resistance falls as the current grows.  `p` says how sharp the
    knee is, `o` how far beyond it the drop is still open: i / (i + i_b) has both at one,
    i / sqrt(i^2 + i_b^2) two and one, 1 - exp(-i / i_b) one and an o near zero, and tanh, erf and
    arctan come within a thousandth.  `a` says how far the two directions differ.

    Args:
        voltage_size: Natural voltage [V].
        current_size: Natural current [A].
    """

    voltage_size: float
    current_size: float

    name: ClassVar[str] = "brush_drop"
    equation: ClassVar[str] = "electrical"
    drivers: ClassVar[tuple[str, ...]] = ("current",)
    source: ClassVar[str] = (
        "Hamilton, DC Motor Control (2000), section on brushes; Holm, Electric Contacts, section 42"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Voltage and knee."""
        return (
            amplitude("voltage", "V", "voltage lost at both brushes", self.voltage_size),
            shape(
                "knee",
                "A",
                "current at the knee",
                3e-3 * self.current_size,
                1.5 * self.current_size,
            ),
            shape("sharpness", "-", "sharpness of the knee", 0.6, 8.0),
            # Not its inverse, nor a logarithm: the posterior of this is nearly normal.
            Parameter(
                "openness",
                "-",
                "how far beyond the knee the drop is still open",
                lower=0.04,
                upper=2.5,
                prior_mean=1.0,
                prior_sd=1.5,
            ),
            asymmetry(),
        )

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Voltage lost [V]."""
        power, openness = values.sharpness, values.openness
        relative = signals.current / values.knee
        size = ca.exp(0.5 * power * ca.log(relative * relative + _SMALLEST**2))
        left = ca.exp(-ca.log(1 + openness * size) / openness)
        nearly_straight = 1 - 0.5 * (1 + openness) * size
        bent = ca.if_else(size < _STRAIGHT, nearly_straight, (1 - left) / size)
        share = relative * ca.exp(ca.log(bent) / power)
        even = ca.sqrt(share * share + _ROUND**2) - _ROUND
        return -values.voltage * (share + values.asymmetry * even)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, its knee scanned."""
        term = cls(survey.voltage, survey.current)
        knees = (0.02, 0.1, 0.4)
        return [
            Candidate(
                term,
                columns(
                    *[(0.03 * survey.voltage, k * survey.current, 2.0, 1.0, 0.0) for k in knees]
                ),
            )
        ]


@dataclass(frozen=True)
class _Saturation(AbstractCoefficient):
    """A coefficient that falls with the size of the current, alike in both directions.

        x -> x (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))

    Its fall begins as c (|i| / i_0)^n, whatever the share s that does not fall.

    Args:
        reference: Current i_0 at which it would have fallen by the factor 1 / (1 + c) [A].
    """

    reference: float

    equation: ClassVar[str] = "electrical"
    drivers: ClassVar[tuple[str, ...]] = ("current",)
    scale: ClassVar[float]
    most: ClassVar[float]
    width: ClassVar[float]
    lasting: ClassVar[Parameter]

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Fall at the reference current, its exponent, and what does not fall."""
        meaning = f"relative fall of {self.coefficient} at {self.reference:.4g} A"
        return (
            Parameter(
                "fall",
                "-",
                meaning,
                scale=self.scale,
                lower=0.0,
                upper=self.most,
                prior_sd=self.width,
            ),
            shape("exponent", "-", "power of the current", 0.8, 6.0),
            self.lasting,
        )

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Factor on the coefficient [-]."""
        ratio = signals.current / self.reference
        size = ratio * ratio + 1e-4
        lasting = getattr(values, self.lasting.name)
        fall = values.fall / (1 - lasting) * ca.exp(0.5 * values.exponent * ca.log(size))
        return lasting + (1 - lasting) / (1 + fall)


@dataclass(frozen=True)
class FluxSaturation(_Saturation):
    """The field weakens as armature current grows: Kt falls with the size of the current.

        Kt -> Kt (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))            [N m/A]

    Even in the current and instantaneous, unlike demagnetisation.  The share s stays where the
    poles that face the current are full.
    """

    name: ClassVar[str] = "flux_saturation"
    source: ClassVar[str] = (
        "Fitzgerald, Kingsley and Umans, Electric Machinery, section on armature reaction"
    )
    coefficient: ClassVar[str] = "Kt"
    scale: ClassVar[float] = 0.05
    most: ClassVar[float] = 3.0
    width: ClassVar[float] = 5.0
    lasting: ClassVar[Parameter] = Parameter(
        "lasting",
        "-",
        "share of Kt that stays at any current",
        scale=0.3,
        lower=0.0,
        upper=0.98,
        prior_mean=0.3,
        prior_sd=2.0,
    )

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, two exponents, and a fall that soon ends."""
        term = cls(1.5 * survey.current)
        return [Candidate(term, columns((0.05, 1.3, 0.3), (0.05, 2.5, 0.3), (0.2, 2.0, 0.95)))]


@dataclass(frozen=True)
class InductanceSaturation(_Saturation):
    """The iron saturates: L falls with the size of the current.

        L -> L (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))              [H]

    The share s is that of the leakage flux, whose path is in air and does not saturate.
    """

    name: ClassVar[str] = "inductance_saturation"
    source: ClassVar[str] = "Fitzgerald, Kingsley and Umans, Electric Machinery, section 1.3"
    coefficient: ClassVar[str] = "L"
    scale: ClassVar[float] = 0.2
    most: ClassVar[float] = 100.0
    width: ClassVar[float] = 20.0
    lasting: ClassVar[Parameter] = Parameter(
        "leakage",
        "-",
        "share of L that leakage keeps at any current",
        scale=0.1,
        lower=0.0,
        upper=0.9,
        prior_mean=0.1,
        prior_sd=2.0,
    )

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, from where saturation begins to where little but leakage is left.

        The declared inductance is that of the usual current, far from the one at rest: few of the
        places show at first what a fit from them gains.
        """
        term = cls(1.5 * survey.current)
        starts = [(0.3, 1.3, 0.1), (0.3, 2.5, 0.1), (1.0, 1.3, 0.4), (1.0, 2.5, 0.1)]
        starts += [(3.0, 1.3, 0.4), (3.0, 2.5, 0.4), (5.0, 2.0, 0.15)]
        return [Candidate(term, columns(*starts))]
