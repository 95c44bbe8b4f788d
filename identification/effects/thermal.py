"""Self-heating of the winding, curvature of Ra(T), and demagnetisation of the magnets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import casadi as ca
import numpy as np

from identification.effects.confusion import RESISTANCE, TORQUE_CONSTANT
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import THERMAL_S, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTemperature,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["Demagnetization", "ResistanceCurvature", "SelfHeating"]


_STEADY: Final = "thermal resistance: steady temperature rise over the loss"
_RATIO: Final = "ratio of the fast to the slow thermal time constant"
_LEAST_RISE: Final = 5.0
"""Smallest rise at the loss scale if no temperature is logged [K].  The surroundings can cause a
smaller rise."""


@register
@dataclass(frozen=True)
class SelfHeating(AbstractEffect, AbstractTemperature):
    """Self-heating: the losses raise the winding temperature above the logged temperature T.

        d(rise)/dt = (R_th (Ra(T + rise) i^2 + P (w / w_0)^2) - rise) / tau     [K/s]
        d(rise_2)/dt = (R_2 Ra(T + rise) i^2 - rise_2) / (q tau)                [K/s]

    The basic law is the first equation without P.  One extended variant adds P, the iron loss at
    the speed w_0.  Another one adds the second equation: rise_2 is the fast rise of the winding
    over a second body.  The winding temperature is then T + rise + rise_2, also in Ra.  In a third
    one, the magnet has the temperature T + s rise: the heat of the winding reaches it too.
    """

    power_size: float
    """Loss scale [W]."""
    fastest: float
    """Shortest thermal time constant [s]."""
    slowest: float
    """Longest thermal time constant [s]."""
    speed_size: float = 0.0
    """Speed scale w_0; zero excludes an iron loss [rad/s]."""
    is_iron: bool = False
    """True if the iron loss is included."""
    bodies: int = 1
    """Number of bodies: one, or two with the winding separate."""
    warms_magnet: bool = False
    """True if the magnet has a share of the rise."""
    least: float = 0.0
    """Lower bound of R_th, as the rise at the loss scale [K]."""

    name = "self_heating"
    heats = True
    confusions = (RESISTANCE,)
    drivers = ("current",)
    source = "Mellor, Roberts and Turner, IEE Proc. B 138 (1991), 205-218 (lumped thermal model)"

    @property
    def bodies_felt(self) -> tuple[str, ...]:
        """The winding, and the magnet if it has a share of the rise."""
        return ("winding", "magnet") if self.warms_magnet else ("winding",)

    @property
    def variant(self) -> str:
        more = ["iron loss"] * self.is_iron + ["two thermal bodies"] * (self.bodies > 1)
        return ", ".join(more + ["warm magnet"] * self.warms_magnet)

    @property
    def richer(self) -> tuple[SelfHeating, ...]:
        """Extended variants: a warm magnet, a second body, or the iron loss."""
        forms = [] if self.warms_magnet else [replace(self, warms_magnet=True)]
        if self.bodies == 1:
            forms.append(replace(self, bodies=2))
        if not self.is_iron and self.speed_size > 0.0:
            forms.append(replace(self, is_iron=True))
        return tuple(forms)

    @property
    def states(self) -> tuple[State, ...]:
        return tuple(State(name, "K") for name in ("rise", "rise_2")[: self.bodies])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        def resistance(name: str, meaning: str, least: float = 0.0) -> Parameter:
            scale, lower = 10.0 / self.power_size, least / self.power_size
            return Parameter(name, "K/W", meaning, scale=scale, lower=lower, prior_sd=20.0)

        found = [
            resistance("resistance", _STEADY, self.least),
            shape("time_constant", "s", "thermal time constant", self.fastest, self.slowest),
        ]
        if self.is_iron:
            meaning, size = f"iron loss at {self.speed_size:.4g} rad/s", self.power_size
            found.append(Parameter("iron", "W", meaning, scale=size, lower=0.0, prior_sd=5.0))
        if self.bodies > 1:
            found += [
                resistance("resistance_2", "thermal resistance between winding and second body"),
                shape("quickness", "-", _RATIO, 5e-3, 0.5),
            ]
        if self.warms_magnet:
            found.append(
                Parameter(
                    "magnet_share", "-", "rise of the magnet over that of the winding", scale=1.0,
                    lower=0.0, upper=1.0, prior_sd=1.0,
                )
            )  # fmt: skip
        return tuple(found)

    def flaw(self, values: Mapping[str, float]) -> str:
        """Reason to reject a second body faster than the bound of a single body; else empty."""
        if self.bodies == 1:
            return ""
        quick = values["quickness"] * values["time_constant"]
        if quick >= self.fastest:
            return ""
        return (
            f"implausible: thermal time constant {1e3 * quick:.3g} ms, expected at least "
            f"{1e3 * self.fastest:.3g} ms; the term acts as a current-dependent voltage"
        )

    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        if body == "magnet":
            return before + values.magnet_share * states.rise
        return before + self._rise(states)

    def _rise(self, states: Values) -> Expression:
        return states.rise + states.rise_2 if self.bodies > 1 else states.rise

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        loss = signals.resistance * signals.current**2
        warm = loss
        if self.is_iron:
            warm = warm + values.iron * (signals.speed / self.speed_size) ** 2
        found = [(values.resistance * warm - states.rise) / values.time_constant]
        if self.bodies > 1:
            quick = values.quickness * values.time_constant
            found.append((values.resistance_2 * loss - states.rise_2) / quick)
        return found

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        power = scales.nominal("Ra25") * scales.current**2
        fastest, slowest = scales.duration / 300, max(scales.run_duration * 5, THERMAL_S)
        is_logged = all(record.expected is None for record in scales.records)
        least = 0.0 if is_logged else _LEAST_RISE
        term = cls(power, fastest, slowest, scales.speed, least=least)
        scanned = scales.duration * np.array([0.01, 0.05, 0.2, 1.0])
        return [Candidate(term, columns(*[(10.0 / power, tau) for tau in scanned]))]


@register
@dataclass(frozen=True)
class ResistanceCurvature(AbstractEffect, AbstractCoefficient):
    """Second-order term in the temperature dependence of the resistance.

    Ra = Ra25 (1 + alpha_Ra (T - 25) + c (T - 25)^2)                    [ohm]

    The extended variant adds a third-order term k (T - 25)^3.
    """

    order: Literal[2, 3] = 2
    """Highest order."""

    name = "resistance_curvature"
    confusions = (RESISTANCE,)
    equation = "thermal"
    drivers = ("temperature",)
    source = "IEC 60751 (second-order law of metal resistance)"
    coefficient = "Ra"

    @property
    def variant(self) -> str:
        return "third order" if self.order > 2 else ""

    @property
    def richer(self) -> tuple[ResistanceCurvature, ...]:
        """The variant with a third-order term."""
        return (replace(self, order=3),) if self.order == 2 else ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        second = Parameter(
            "curvature", "1/K^2", "second-order coefficient of the resistance", scale=5e-6,
            lower=-1e-4, upper=1e-4, prior_sd=5.0,
        )  # fmt: skip
        third = Parameter(
            "third_order", "1/K^3", "third-order coefficient of the resistance", scale=5e-8,
            lower=-1e-6, upper=1e-6, prior_sd=5.0,
        )  # fmt: skip
        return (second, third)[: self.order - 1]

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        rise = signals.winding_temperature - 25
        added = values.curvature * rise**2
        if self.order > 2:
            added = added + values.third_order * rise**3
        return 1 + added / (1 + values.alpha_Ra * rise)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [Candidate(cls(), columns((5e-6,), (-5e-6,)))] if scales.heated >= 10.0 else []


@register
@dataclass(frozen=True)
class Demagnetization(AbstractEffect, AbstractCoefficient):
    """Irreversible loss of Kt above a threshold temperature.

        Kt -> Kt (1 - d s((T_peak - T_c) / width))                          [N m/A]

    d is the lost fraction of Kt, T_peak the highest temperature logged so far in the campaign, T_c
    the threshold and s a smooth step.  A narrow width is a sudden loss; with a wide one the loss
    grows with every kelvin above T_c.
    """

    coldest: float
    """Lowest temperature logged [degC]."""
    hottest: float
    """Highest [degC]."""

    name = "demagnetization"
    confusions = (TORQUE_CONSTANT,)
    plotted = ("peak_temperature",)
    equation = "thermal"
    drivers = ("temperature", "time")
    source = "Ruoho et al., IEEE Trans. Magnetics 44 (2008), 2072-2079 (partial demagnetisation)"
    coefficient = "Kt"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        span = self.hottest - self.coldest
        return (
            Parameter(
                "loss", "-", "lost fraction of Kt", scale=0.05, lower=-0.5, upper=0.9, prior_sd=5.0
            ),
            Parameter(
                "temperature", "degC", "threshold temperature of the loss", scale=span / 20,
                lower=self.coldest, upper=self.hottest,
                prior_mean=0.5 * (self.coldest + self.hottest), prior_sd=20.0,
            ),
            shape("width", "K", "temperature range over which the loss grows", 0.3, 1.5 * span),
        )  # fmt: skip

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        late = (signals.peak_temperature - values.temperature) / values.width
        return 1 - values.loss * 0.5 * (1 + late / ca.sqrt(late * late + 1))

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        coldest, hottest = scales.temperatures
        if scales.heated < 5.0:
            return []
        term = cls(coldest, hottest)
        scanned = coldest + (hottest - coldest) * np.linspace(0.1, 0.95, 10)
        return [Candidate(term, columns(*[(0.05, t, 2.0) for t in scanned]))]
