"""Friction and drag torques, and the temperature dependence of viscous friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import casadi as ca

from identification.effects.confusion import FRICTION
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import amplitude, asymmetry, columns, shape, uneven
from identification.effects.runs import AbstractExcess
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTorque,
    Expression,
    Signals,
    Values,
)

__all__ = [
    "SHARPER",
    "SIGN_WIDTH",
    "CoulombFriction",
    "QuadraticDrag",
    "StribeckFriction",
    "ViscousTemperature",
]

SIGN_WIDTH: Final = 1e-3
"""Width of the smoothed sign over the speed scale.  The smoothing loses about 0.1 % of the friction
work, less than the standard deviation of a torque estimated from 10,000 samples."""

_SLOWEST: Final = 2.0
_FASTEST: Final = 100.0
"""Creep speed over the width of the smoothed sign: a slower one is not distinguishable from the
smoothing, and a faster one, a tenth of the speed scale, not from viscous friction."""

SHARPER: Final = 0.1
"""Ratio of the widths of a sharper sign and of this one."""

_SPREAD: Final = 0.05
"""First guess of the differences between runs, over the torque scale."""

_LEAST_LEFT = 0.01
"""Lower limit of 1 - f k (T - 25), the remaining fraction of the friction to the power f."""
_NEARLY_NONE = 1e-4
"""Magnitude of f k (T - 25) below which the logarithm is taken from its series."""


@dataclass(frozen=True)
class _Friction(AbstractEffect, AbstractTorque):
    """Torque against the motion that depends on the speed."""

    torque_size: float
    """Torque scale [N m]."""

    confusions = (FRICTION,)
    drivers = ("speed",)


@register
@dataclass(frozen=True)
class CoulombFriction(_Friction, AbstractExcess):
    """Coulomb friction: a torque against the motion that does not depend on the speed.

        tau = -T_c (1 + a sgn w) / (1 + a d) sgn w                          [N m]

    The sign is smoothed over a small fraction of the speed.  `a` is the asymmetry between the two
    directions, as in brush gear and preloaded bearings.  T_c is the mean of both directions (d = 0)
    or, if the runs turn in one direction only, the torque in that one (d = 1 or -1).  Seals and
    greased contacts creep before they slide: in an extended variant, the speed `creep` in place of
    the smoothing is estimated, and sgn w is w / sqrt(w^2 + creep^2).

    Brushes and seals run in, and the preload of bearings changes with each mounting.  In another
    extended variant, T_c + c stands in place of T_c, with an `excess` c that is free in each
    record, as a constant state.  The setting `spread` in a result is then the root mean square of
    these excesses [N m].
    """

    width: float
    """Width of the smoothed sign [rad/s]."""
    creeps: bool = False
    """True if the width of the sign is a parameter, the creep speed."""
    direction: int = 0
    """Sign of the speed of all runs; 0 if they turn in both directions."""

    name = "coulomb_friction"
    unit = "N m"
    common = "torque"
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138"

    @property
    def variant(self) -> str:
        """The creep, if it is estimated, and the separate torques, if there are any."""
        return self.in_variant("creeping before it slides" if self.creeps else "")

    @property
    def richer(self) -> tuple[CoulombFriction, ...]:
        """The variants with a separate torque for each run, and with an estimated creep speed."""
        spread = _SPREAD * self.torque_size
        each = (replace(self, spread=spread),) if self.several and not self.varies else ()
        return each if self.creeps else (*each, replace(self, creeps=True))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        side = "in the direction of the runs" if self.direction else "mean of both directions"
        torque = f"Coulomb friction torque, {side}"
        own = (amplitude("torque", "N m", torque, self.torque_size), asymmetry())
        if not self.creeps:
            return own
        slowest, fastest = _SLOWEST * self.width, _FASTEST * self.width
        meaning = "speed at which the friction is 0.71 of that in sliding"
        return (*own, shape("creep", "rad/s", meaning, slowest, fastest))

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        # Algebraic, so that it costs one square root.
        width = values.creep if self.creeps else self.width
        sign = signals.speed / ca.sqrt(signals.speed * signals.speed + width * width)
        size = self.of_run(values.torque, states)
        return -size * uneven(sign, values.asymmetry, self.direction)

    @property
    def sharper(self) -> CoulombFriction:
        """The term with a ten times narrower sign; unchanged if the width is estimated."""
        return self if self.creeps else replace(self, width=SHARPER * self.width)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        term = cls(
            scales.torque,
            SIGN_WIDTH * scales.speed,
            direction=scales.direction(1),
            several=len(scales.runs) > 1,
        )
        return [Candidate(term, columns((0.05 * scales.torque, 0.0)))]


@register
@dataclass(frozen=True)
class StribeckFriction(_Friction):
    """Stribeck friction: extra dry friction at low speed that fades as a lubricant film builds up.

        tau = -T_s exp(-(|w| / w_s)^d) sgn w                                [N m]

    With d between 1/2 and 2 the family contains Tustin's law, the Gaussian law and, approximately,
    the Lorentzian law of Hess and Soom.
    """

    speed_size: float
    """Speed scale [rad/s]."""
    width: float
    """Width of the smoothed sign [rad/s]."""

    name = "stribeck_friction"
    defining = ("exponent",)
    source = (
        "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138; Hess and "
        "Soom, J. Tribology 112 (1990), 147-152"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            amplitude(
                "torque", "N m", "additional friction torque at standstill", self.torque_size
            ),
            shape(
                "speed", "rad/s", "speed at which the additional friction has fallen to 1/e",
                5.0 * self.width, 1.0 * self.speed_size,
            ),
            shape("exponent", "-", "exponent of the speed", 0.5, 3.0),
        )  # fmt: skip

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        speed = signals.speed
        size = ca.sqrt(speed * speed + self.width * self.width)
        fading = ca.exp(-ca.exp(values.exponent * ca.log(size / values.speed)))
        return -values.torque * fading * speed / size

    @property
    def sharper(self) -> StribeckFriction:
        """The term with a ten times narrower sign."""
        return replace(self, width=SHARPER * self.width)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        term = cls(scales.torque, scales.speed, SIGN_WIDTH * scales.speed)
        starts = [(0.05 * scales.torque, f * scales.speed, 1.0) for f in (0.03, 0.1, 0.3)]
        return [Candidate(term, columns(*starts))]


@register
@dataclass(frozen=True)
class QuadraticDrag(_Friction):
    """Fan or windage torque that grows with about the square of the speed.

        tau = -T_d (|w| / w_0)^n (1 + a sgn w) / (1 + a d) sgn w            [N m]

    `a` is the asymmetry between the two directions, as with the blades of a fan, and d that of the
    runs, as for Coulomb friction.
    """

    reference: float
    """Speed w_0 at which the torque is T_d [rad/s]."""
    direction: int = 0
    """Sign of the speed of all runs; 0 if they turn in both directions."""

    name = "quadratic_drag"
    defining = ("exponent",)
    source = (
        "Vrancik, NASA TN D-4849 (1968) (windage); affinity laws of fans, torque with speed squared"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            amplitude(
                "torque", "N m", f"drag torque at {self.reference:.4g} rad/s", self.torque_size
            ),
            shape("exponent", "-", "exponent of the speed", 1.5, 2.5),
            asymmetry(),
        )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        ratio = signals.speed / self.reference
        size = ca.sqrt(ratio * ratio + 1e-6)
        power = ca.exp(values.exponent * ca.log(size))
        return -values.torque * power * uneven(ratio / size, values.asymmetry, self.direction)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        term = cls(scales.torque, scales.speed, scales.direction(1))
        return [Candidate(term, columns((0.05 * scales.torque, 2.0, 0.0)))]


@register
@dataclass(frozen=True)
class ViscousTemperature(AbstractEffect, AbstractCoefficient):
    """Temperature dependence of viscous friction, as of grease that thins when it warms.

        b(T) = b (1 - f k (T - 25))^(1/f)                                   [N m s/rad]

    The form f selects the law.  f = 0 is Reynolds' exponential law of viscosity, f = 1 a straight
    line, and f < 0 a fall that becomes slower with temperature, as in Vogel's law.  f is estimated,
    so the uncertainty of b at 25 degC includes that of the law.
    """

    name = "viscous_temperature"
    confusions = (FRICTION,)
    equation = "mechanical"
    drivers = ("speed", "temperature")
    plotted = ("temperature",)
    source = "Reynolds, Phil. Trans. R. Soc. 177 (1886), 157-234 (viscosity falls exponentially)"
    coefficient = "b"
    parameters = (
        Parameter(
            "rate", "1/K", "relative decrease of b per kelvin at 25 degC", scale=5e-3, lower=-0.05,
            upper=0.1, prior_sd=3.0,
        ),
        Parameter(
            "form", "-",
            "form of the law: 1 linear, 0 exponential, negative flatter at high temperature",
            scale=1.0, lower=-2.0, upper=1.0, prior_mean=0.0, prior_sd=0.7,
        ),
    )  # fmt: skip

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        fall = values.rate * (signals.temperature - 25)
        part = ca.fmin(values.form * fall, 1 - _LEAST_LEFT)
        is_small = ca.fabs(part) < _NEARLY_NONE
        larger = ca.if_else(is_small, _NEARLY_NONE, part)
        bent = ca.if_else(is_small, 1 + part / 2, -ca.log(1 - larger) / larger)
        return ca.exp(-fall * bent)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        if scales.heated < 3.0:
            return []
        return [Candidate(cls(), columns((0.01, 0.2), (-0.005, 0.2)))]
