"""External load torques, and an elastic shaft."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.effects.confusion import CONSTANT_TORQUE, SINGLE_RUN
from identification.effects.effect import (
    AbstractEffect,
    AbstractRunEffect,
    CampaignScales,
    Candidate,
    register,
    runs_text,
)
from identification.effects.parameters import amplitude, columns, shape
from identification.effects.runs import EACH_RUN, in_runs
from identification.effects.span import LoadSpan, load_moments, short_load, tried_spans, within
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTorque,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = [
    "AbstractSecondInertia",
    "LoadStep",
    "LoadTorque",
    "ShaftCompliance",
    "resonances",
    "share_of_inertia",
]

_LEAST_RANGE: Final = 2.0


class AbstractSecondInertia(AbstractEffect, AbstractTorque, AbstractCoefficient):
    """Two-mass system: a second inertia that the rotor drives through a joint.

        J -> J (1 - s),   J_2 = s J,   tau = -J_2 a
        dtheta/dt = w - w_2,   dw_2/dt = a(theta, w - w_2)

    Here s is the fraction of the inertia behind the joint, theta the twist and w_2 the speed of the
    second inertia.  J remains the total inertia, which determines slow motions.  The subclasses
    define the joint: an elastic shaft, or a contact with play.

    If the inertia of a run is another one, both parts change in proportion, and the joint does not:
    a is then smaller by the ratio of the inertias, and tau is the same.
    """

    coefficient = "J"
    states = (State("twist", "rad", fades=True), State("speed", "rad/s", "speed", fades=True))

    @abstractmethod
    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        """Acceleration of the second inertia by the joint [rad/s^2].

        Twist [rad] and slip [rad/s] are the angle and the speed of the rotor minus those of the
        second inertia; the values are the parameters of the term and the nominal ones.
        """

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        return 1 - values.share

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        slip = signals.speed - states.speed
        return -values.share * values.J * self.pull(states.twist, slip, values)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        slip = signals.speed - states.speed
        nominal = values.J * (1 - values.share)
        return [slip, self.pull(states.twist, slip, values) * nominal / signals.inertia]


def share_of_inertia(meaning: str) -> Parameter:
    """Parameter of the fraction s of the inertia behind the joint."""
    return shape("share", "-", meaning, 0.003, 0.99)


def resonances(scales: CampaignScales) -> tuple[float, float] | None:
    """Lowest and highest identifiable resonance [rad/s]; None if their ratio is below two.

    The duration of the longest record limits the lowest, the sample interval the highest.
    """
    slowest, fastest = 20.0 / scales.duration, 2.5 / scales.interval
    return None if fastest < _LEAST_RANGE * slowest else (slowest, fastest)


@register
@dataclass(frozen=True)
class LoadTorque(AbstractEffect, AbstractTorque):
    """Constant external torque, such as that of a hanging weight.

    tau = -T_l                                                          [N m]

    If the weight is another one in each run, the torque is free in each record, as a constant
    state.  The setting `torque_size` in a result is then the root mean square of these torques
    [N m].
    """

    torque_size: float
    """Torque scale [N m]."""
    own: bool = False
    """True if the torque is free in each record."""

    name = "load_torque"
    amplitude_scale = "torque_size"
    confusions = (CONSTANT_TORQUE,)
    drivers = ()
    source = "Krishnan, Electric Motor Drives (2001), section 2.3"

    @property
    def variant(self) -> str:
        """The separate torques, if there are any."""
        return EACH_RUN if self.own else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        constant = amplitude("torque", "N m", "constant load torque", self.torque_size, signed=True)
        return () if self.own else (constant,)

    @property
    def varies(self) -> bool:
        return self.own

    @property
    def states(self) -> tuple[State, ...]:
        return (State("torque", "N m", scale=self.torque_size, is_own=True),) if self.own else ()

    @property
    def richer(self) -> tuple[LoadTorque, ...]:
        """The variant with a torque free in each record, unless it is that already."""
        return () if self.own else (replace(self, own=True),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -states.torque if self.own else -values.torque

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One torque in all runs and, with several runs, one that is free in each record."""
        constant = Candidate(cls(scales.torque), columns((0.05 * scales.torque,)))
        own = replace(constant, fitted=cls(scales.torque, own=True))
        return [constant, own] if len(scales.runs) > 1 else [constant]


@register
@dataclass(frozen=True)
class LoadStep(AbstractRunEffect, AbstractTorque):
    """External torque during one time span of a run, or the same span of several runs.

        tau = -T_l   while start <= t < stop in run r                       [N m]

    The torque is zero in all other runs.  The edges are smoothed over two sample intervals, so that
    the times can be fitted.  If the load is another one in each run, as that of a brake with
    weights, the span is that of all runs, and the torque is free in each record, as a constant
    state.
    """

    torque_size: float
    """Torque scale [N m]."""
    edge: float
    """Width of an edge [s]."""
    duration: float
    """Duration of the longest run [s]."""

    name = "load_step"
    confusions = (SINGLE_RUN,)
    drivers = ("time",)
    moments = ("start", "stop")
    laws = (LoadSpan,)
    scope = "one span"
    source = "Krishnan, Electric Motor Drives (2001), section 2.3"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"load torque in {runs_text(self.runs)}"
        torque = amplitude("torque", "N m", meaning, self.torque_size, signed=True)
        return (torque, *load_moments(self.duration))

    def flaw(self, values: Mapping[str, float]) -> str:
        return short_load(values, self.edge)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        here = in_runs(signals, self.runs)
        return -values.torque * here * within(signals, values, self.edge)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate for single runs and groups of runs, and for all with a torque of each."""
        term = cls(None, scales.torque, 2 * scales.interval, scales.run_duration)
        starts = [(0.1 * scales.torque, *span) for span in tried_spans(scales)]
        each_run = next(iter(LoadSpan.candidates(scales)), None)
        return [Candidate(term, columns(*starts), each_run=each_run)]


@register
@dataclass(frozen=True)
class ShaftCompliance(AbstractSecondInertia):
    """Two-mass system: part of the inertia J is driven through an elastic shaft.

        J -> J (1 - s),   J_2 = s J,   tau = -J_2 a
        J_2 a = k g theta + c (w - w_2),   g = 1 + h (k theta / T)^2
        dtheta/dt = w - w_2,               dw_2/dt = a

    Here s is the fraction of the inertia behind the shaft, theta the twist and w_2 the speed of the
    second inertia.  With k = J_2 w_0^2 and c = 2 z J_2 w_0, w_0 is the natural frequency of the
    second inertia with the rotor held, and z its damping ratio.  `h` is the relative increase of
    the stiffness at the torque T.  J remains the total inertia, which determines slow motions.

    The damping is at most critical: a joint that cannot oscillate is no elastic shaft, and would
    stand for any other lag.  Elastomer couplings have a relative damping of about 1 (DIN 740-2), so
    that z = 1 / (4 pi) = 0.08.
    """

    torque_size: float
    """Torque scale T [N m]."""
    slowest: float
    """Lowest resonance that is distinguishable from a rigid shaft [rad/s]."""
    fastest: float
    """Highest resonance that the sampling resolves [rad/s]."""

    name = "shaft_compliance"
    drivers = ("speed",)
    source = "Leonhard, Control of Electrical Drives, 3rd edition, section 1.1.2"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            share_of_inertia("fraction of the inertia J behind the elastic shaft"),
            shape(
                "resonance", "rad/s", "natural frequency of the second inertia, rotor held",
                self.slowest, self.fastest,
            ),
            shape("damping", "-", "damping ratio of the second inertia, rotor held", 0.002, 1.0),
            Parameter(
                "hardening", "-",
                f"relative increase of the stiffness at {self.torque_size:.4g} N m", scale=0.1,
                lower=-0.2, upper=50.0, prior_sd=10.0,
            ),
        )  # fmt: skip

    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        stiffness = values.resonance**2
        torque = values.share * values.J * stiffness * twist / self.torque_size
        spring = stiffness * twist * (1 + values.hardening * torque * torque)
        return spring + 2 * values.damping * values.resonance * slip

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its resonance scanned with heavy damping."""
        reach = resonances(scales)
        if reach is None:
            return []
        slowest, fastest = reach
        term = cls(scales.torque, slowest, fastest)
        scanned = np.geomspace(1.5 * slowest, 0.7 * fastest, 16)
        starts = [(share, w, 0.3, 0.0) for share in (0.2, 0.5) for w in scanned]
        return [Candidate(term, columns(*starts))]
