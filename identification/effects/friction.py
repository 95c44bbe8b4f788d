"""Torques of friction and drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from identification.effects.effect import Candidate, Survey, amplitude, asymmetry, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTorque,
    Expression,
    Signals,
    Values,
)

__all__ = ["CoulombFriction", "QuadraticDrag", "StribeckFriction", "ViscousTemperature"]

_WIDTH = 1e-3
"""Width of the smoothed sign over the size of the speed: the work of friction that it loses is
about a thousandth, less than the standard deviation of the torque on 10,000 samples."""

_LEAST_LEFT = 0.01
"""Share of the friction, to the power of its form, that is always left."""
_NEARLY_NONE = 1e-4
"""Part of the fall below which its logarithm is taken from its series."""


def smooth_sign(x: Expression, width: float) -> Expression:
    """A sign that passes through zero over `width`; algebraic, so that it costs one root."""
    return x / ca.sqrt(x * x + width * width)


@dataclass(frozen=True)
class CoulombFriction(AbstractTorque):
    """Dry friction: a torque against the motion, whatever the speed.

        tau = -T_c (1 + a sgn w) sgn w                                      [N m]

    The sign is smoothed over a small fraction of the speed; `a` lets the two directions differ,
    as brush gear and preloaded bearings do.

    Args:
        torque_size: Natural torque [N m].
        width: Width of the smoothed sign [rad/s].
    """

    torque_size: float
    width: float

    name: ClassVar[str] = "coulomb_friction"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    source: ClassVar[str] = (
        "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Torque and asymmetry."""
        return (
            amplitude("torque", "N m", "dry friction torque", self.torque_size),
            asymmetry(),
        )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque against the motion [N m]."""
        sign = smooth_sign(signals.speed, self.width)
        return -values.torque * (1 + values.asymmetry * sign) * sign

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure."""
        term = cls(survey.torque, _WIDTH * survey.speed)
        return [Candidate(term, columns((0.05 * survey.torque, 0.0)))]


@dataclass(frozen=True)
class StribeckFriction(AbstractTorque):
    """Extra dry friction at low speed that fades as a lubricant film builds up.

        tau = -T_s exp(-(|w| / w_s)^d) sgn w                                [N m]

    With d between one half and two the family holds Tustin's law, the Gaussian one and, closely,
    the Lorentzian one of Hess and Soom.

    Args:
        torque_size: Natural torque [N m].
        speed_size: Natural speed [rad/s].
        width: Width of the smoothed sign [rad/s].
    """

    torque_size: float
    speed_size: float
    width: float

    name: ClassVar[str] = "stribeck_friction"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    defining: ClassVar[tuple[str, ...]] = ("exponent",)
    source: ClassVar[str] = (
        "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138; Hess and "
        "Soom, J. Tribology 112 (1990), 147-152"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Torque, speed and exponent."""
        return (
            amplitude("torque", "N m", "extra friction at standstill", self.torque_size),
            shape(
                "speed",
                "rad/s",
                "speed at which it has fallen to 1/e",
                5.0 * self.width,
                1.0 * self.speed_size,
            ),
            shape("exponent", "-", "steepness of the fall", 0.5, 3.0),
        )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque against the motion [N m]."""
        speed = signals.speed
        size = ca.sqrt(speed * speed + self.width * self.width)
        fading = ca.exp(-ca.exp(values.exponent * ca.log(size / values.speed)))
        return -values.torque * fading * speed / size

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, its speed scanned."""
        term = cls(survey.torque, survey.speed, _WIDTH * survey.speed)
        starts = [(0.05 * survey.torque, f * survey.speed, 1.0) for f in (0.03, 0.1, 0.3)]
        return [Candidate(term, columns(*starts))]


@dataclass(frozen=True)
class QuadraticDrag(AbstractTorque):
    """Torque of a fan or of windage, growing with about the square of speed.

        tau = -T_d (|w| / w_0)^n (sgn w + a)                                [N m]

    with `a` how far the two directions differ, as the blades of a fan make them.

    Args:
        torque_size: Natural torque [N m].
        reference: Speed w_0 at which the torque is T_d [rad/s].
    """

    torque_size: float
    reference: float

    name: ClassVar[str] = "quadratic_drag"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    defining: ClassVar[tuple[str, ...]] = ("exponent",)
    source: ClassVar[str] = (
        "Vrancik, NASA TN D-4849 (1968) (windage); affinity laws of fans, torque with speed squared"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Torque at the reference speed and exponent."""
        return (
            amplitude("torque", "N m", f"drag at {self.reference:.4g} rad/s", self.torque_size),
            shape("exponent", "-", "power of the speed", 1.5, 2.5),
            asymmetry(),
        )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque against the motion [N m]."""
        ratio = signals.speed / self.reference
        size = ca.sqrt(ratio * ratio + 1e-6)
        even = ca.exp((values.exponent - 1) * ca.log(size))
        return -values.torque * ratio * even * (1 + values.asymmetry * ratio / size)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure."""
        return [
            Candidate(cls(survey.torque, survey.speed), columns((0.05 * survey.torque, 2.0, 0.0)))
        ]


@dataclass(frozen=True)
class ViscousTemperature(AbstractCoefficient):
    """Grease that thins as it warms: viscous friction changes with temperature.

        b(T) = b (1 - f k (T - 25))^(1/f)                                   [N m s/rad]

    which is Reynolds' exponential law of viscosity for a form f of zero, a straight line for one of
    one, and falls fast at first and then ever slower, as Vogel's law, for one below zero.  Which it
    is is left open, so that b at 25 degC is as uncertain as the law.
    """

    name: ClassVar[str] = "viscous_temperature"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed", "temperature")
    source: ClassVar[str] = (
        "Reynolds, Phil. Trans. R. Soc. 177 (1886), 157-234 (viscosity falls exponentially)"
    )
    coefficient: ClassVar[str] = "b"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "rate",
            "1/K",
            "relative fall of the friction per kelvin",
            scale=5e-3,
            lower=-0.05,
            upper=0.1,
            prior_sd=3.0,
        ),
        Parameter(
            "form",
            "-",
            "form of the law: straight (1), exponential (0), or slower in the heat",
            scale=1.0,
            lower=-2.0,
            upper=1.0,
            prior_mean=0.0,
            prior_sd=0.7,
        ),
    )

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Factor on b [-]."""
        fall = values.rate * (signals.temperature - 25)
        part = ca.fmin(values.form * fall, 1 - _LEAST_LEFT)
        is_small = ca.fabs(part) < _NEARLY_NONE
        larger = ca.if_else(is_small, _NEARLY_NONE, part)
        bent = ca.if_else(is_small, 1 + part / 2, -ca.log(1 - larger) / larger)
        return ca.exp(-fall * bent)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, where the temperature moves at all."""
        if survey.heated < 3.0:
            return []
        return [Candidate(cls(), columns((0.01, 0.2), (-0.005, 0.2)))]
