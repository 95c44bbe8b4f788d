"""Brush drop, and saturation of torque constant and inductance with the armature current."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import casadi as ca
import numpy as np

from identification.effects.confusion import BRUSHES, INDUCTANCE, TORQUE_CONSTANT
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import amplitude, asymmetry, columns, shape
from identification.effects.runs import AbstractExcess
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)

_ROUND: Final = 0.02
"""Width over which |s| is smoothed at zero, so that it is differentiable."""
_SMALLEST: Final = 1e-4
"""Relative current |i / i_b| below which its magnitude is smoothed."""
_STRAIGHT: Final = 1e-6
"""Value of |i / i_b|^p below which the drop is taken from its series."""
_LEAST_HEATED: Final = 10.0
"""Least range of the logged temperature that shows how the brush drop changes with it [K]."""
_REFERENCE: Final = 1.5
"""Reference current i_0 of a saturation, over the usual current, the RMS current of the runs."""
_SPREAD: Final = 0.01
"""First guess of the differences of the drop between runs, over the voltage scale."""
_RATE: Final = Parameter(
    "rate", "1/K", "relative change of the drop per kelvin, c in the formula", scale=2e-3,
    lower=-8e-3, upper=8e-3, prior_sd=2.0,
)  # fmt: skip

__all__ = ["BrushDrop", "FluxSaturation", "InductanceSaturation"]


@register
@dataclass(frozen=True)
class BrushDrop(AbstractExcess, AbstractVoltage):
    """Voltage drop at the brush contacts, with the sign of the current.

        v = -V_b s (1 + a sgn s) / (1 + a d),   |s|^p = 1 - (1 + o |i / i_b|^p)^(-1/o)      [V]

    s has the sign of i, and |s| rises from 0 to 1.  `i_b` is the current of the knee: if it is far
    below the motor's current, the drop is a step; if it is comparable, the drop is that of a
    contact whose resistance falls with current.  `p` sets the sharpness of the knee, and `o` (the
    parameter `openness`) the slowness of the saturation beyond it.  For i > 0, s is i / (i + i_b)
    with p = 1 and o = 1, i / sqrt(i^2 + i_b^2) with p = 2 and o = 1, and 1 - exp(-i / i_b) with
    p = 1 and o near 0.  Other values approximate tanh, erf and arctan within 0.001.  `a` is the
    asymmetry between the two directions.  V_b is the mean of both (d = 0) or, if the current of the
    runs has one sign only, the drop at that sign (d = 1 or -1).  The contact voltage of carbon
    falls as it warms: in an extended variant, V_b is V_b (1 + c (T - 25)), with the logged
    temperature T.  The film on the commutator builds up and wears: in another one, V_b + e stands
    in place of V_b, with an `excess` e that is free in each record, as a constant state.  The
    setting `spread` in a result is then the root mean square of these excesses [V].
    """

    voltage_size: float
    """Voltage scale [V]."""
    current_size: float
    """Current scale [A]."""
    is_heated: bool = False
    """True if the temperatures of the runs differ enough to show a dependence on them."""
    changes: bool = False
    """True if the drop changes with temperature."""
    direction: int = 0
    """Sign of the current of all runs; 0 if it has both."""

    name = "brush_drop"
    unit = "V"
    common = "voltage"
    confusions = (BRUSHES,)
    drivers = ("current",)
    source = (
        "Hamilton, DC Motor Control (2000), section on brushes; Holm, Electric Contacts, section 42"
    )

    @property
    def variant(self) -> str:
        """The temperature dependence, if it is estimated, and the separate drops, if any."""
        return self.in_variant("changing with temperature" if self.changes else "")

    @property
    def richer(self) -> tuple[BrushDrop, ...]:
        """The variants with a drop that changes with temperature, and with one of each run."""
        found = []
        if self.is_heated and not self.changes:
            found.append(replace(self, changes=True))
        if self.several and not self.varies:
            found.append(replace(self, spread=_SPREAD * self.voltage_size))
        return tuple(found)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        own = (
            amplitude(
                "voltage", "V", "voltage drop of both brushes at high current", self.voltage_size
            ),
            shape(
                "knee", "A", "current of the knee", 3e-3 * self.current_size,
                1.5 * self.current_size,
            ),
            shape("sharpness", "-", "sharpness of the knee, p in the formula", 0.6, 8.0),
            # Searched as it is, not inverse or logarithm: its posterior is then nearly normal.
            Parameter(
                "openness", "-", "slowness of the saturation beyond the knee, o in the formula",
                lower=0.04, upper=2.5, prior_mean=1.0, prior_sd=1.5,
            ),
            asymmetry(),
        )  # fmt: skip
        return (*own, _RATE) if self.changes else own

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        power, openness = values.sharpness, values.openness
        relative = signals.current / values.knee
        size = ca.exp(0.5 * power * ca.log(relative * relative + _SMALLEST**2))
        left = ca.exp(-ca.log(1 + openness * size) / openness)
        nearly_straight = 1 - 0.5 * (1 + openness) * size
        bent = ca.if_else(size < _STRAIGHT, nearly_straight, (1 - left) / size)
        share = relative * ca.exp(ca.log(bent) / power)
        even = ca.sqrt(share * share + _ROUND**2) - _ROUND
        one_way = 1 + values.asymmetry * self.direction
        full = self.of_run(values.voltage, states)
        drop = full * (share + values.asymmetry * even) / one_way
        return -drop * (1 + values.rate * (signals.temperature - 25)) if self.changes else -drop

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        drop, knees = 0.03 * scales.voltage, (0.02, 0.1, 0.4)
        starts = [(drop, knee * scales.current, 2.0, 1.0, 0.0) for knee in knees]
        is_heated = scales.heated >= _LEAST_HEATED
        direction = scales.direction(0)
        several = len(scales.runs) > 1
        term = cls(scales.voltage, scales.current, is_heated, direction=direction, several=several)
        return [Candidate(term, columns(*starts))]


@dataclass(frozen=True)
class _Saturation(AbstractEffect, AbstractCoefficient):
    """Saturation of a coefficient x by the magnitude of the current, even in the current.

        x -> x (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))
        x -> x (s + (1 - s) exp(-c / (1 - s) (|i| / i_0)^n))

    s is the fraction that does not saturate.  For small currents the relative fall of both laws is
    c (|i| / i_0)^n, whatever s.
    """

    reference: float
    """Current i_0 at which the factor is 1 / (1 + c), or exp(-c), if s is zero [A]."""
    is_exponential: bool = False
    """True for the second law."""

    equation = "electrical"
    drivers = ("current",)
    scale: ClassVar[float]
    most: ClassVar[float]
    width: ClassVar[float]
    lasting: ClassVar[Parameter]

    @property
    def variant(self) -> str:
        return "exponential" if self.is_exponential else ""

    @property
    def rival_laws(self) -> tuple[Self, ...]:
        """The other law."""
        return (replace(self, is_exponential=not self.is_exponential),)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"relative fall of {self.coefficient} at {self.reference:.4g} A"
        return (
            Parameter(
                "fall", "-", meaning, scale=self.scale, lower=0.0, upper=self.most,
                prior_sd=self.width,
            ),
            shape("exponent", "-", "exponent of the current", 0.8, 6.0),
            self.lasting,
        )  # fmt: skip

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        lasting = getattr(values, self.lasting.name)
        return self._remaining(signals.current, values.fall, values.exponent, lasting)

    def _remaining(
        self, current: Expression, fall: Expression, exponent: Expression, lasting: Expression
    ) -> Expression:
        """Fraction of the coefficient that remains at a current [-]."""
        ratio = current / self.reference
        size = ratio * ratio + 1e-4
        relative = fall / (1 - lasting) * ca.exp(0.5 * exponent * ca.log(size))
        left = ca.exp(-relative) if self.is_exponential else 1 / (1 + relative)
        return lasting + (1 - lasting) * left


@register
@dataclass(frozen=True)
class FluxSaturation(_Saturation):
    """Armature reaction: Kt falls with the magnitude of the current, as the field weakens.

        Kt -> Kt (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))            [N m/A]
        Kt -> Kt (s + (1 - s) exp(-c / (1 - s) (|i| / i_0)^n))              [N m/A]

    The fall is even in the current and instantaneous, unlike demagnetisation.  The fraction s of
    Kt remains once the poles that face the armature current are saturated.
    """

    name = "flux_saturation"
    confusions = (TORQUE_CONSTANT,)
    source = "Fitzgerald, Kingsley and Umans, Electric Machinery, section on armature reaction"
    coefficient = "Kt"
    scale = 0.05
    most = 3.0
    width = 5.0
    lasting = Parameter(
        "lasting", "-", "fraction of Kt that does not saturate", scale=0.3, lower=0.0, upper=0.98,
        prior_mean=0.3, prior_sd=2.0,
    )  # fmt: skip

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate with three starts: two exponents, and a fall that soon ends."""
        term = cls(_REFERENCE * scales.current)
        return [Candidate(term, columns((0.05, 1.3, 0.3), (0.05, 2.5, 0.3), (0.2, 2.0, 0.95)))]


@register
@dataclass(frozen=True)
class InductanceSaturation(_Saturation):
    """Saturation of the iron: L falls with the magnitude of the current.

        L -> L (s + (1 - s) / (1 + c / (1 - s) (|i| / i_0)^n))              [H]
        L -> L (s + (1 - s) exp(-c / (1 - s) (|i| / i_0)^n))                [H]

    The fraction s belongs to the leakage flux, whose path is in air and does not saturate.
    """

    name = "inductance_saturation"
    confusions = (INDUCTANCE,)
    source = "Fitzgerald, Kingsley and Umans, Electric Machinery, section 1.3"
    coefficient = "L"
    scale = 0.2
    most = 100.0
    width = 20.0
    lasting = Parameter(
        "leakage", "-", "fraction of L that does not saturate (leakage flux)", scale=0.1, lower=0.0,
        upper=0.9, prior_mean=0.1, prior_sd=2.0,
    )  # fmt: skip

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, with starts from the onset of saturation to little more than leakage.

        The nominal inductance is that at the usual current, far from that at zero current.  A
        prototype is therefore scored with its inductance at that current unchanged, and a refit
        starts with the larger inductance at zero current.
        """
        starts = [(0.3, 1.3, 0.1), (0.3, 2.5, 0.1), (1.0, 1.3, 0.4), (1.0, 2.5, 0.1)]
        starts += [(3.0, 1.3, 0.4), (3.0, 2.5, 0.4), (5.0, 2.0, 0.15)]
        term, scored = (kind(_REFERENCE * scales.current) for kind in (cls, _ScoredInductance))
        raised = [1.0 / float(term._remaining(scales.current, *start)) for start in starts]
        traded = tuple(
            (np.array(start), {"L": factor}) for start, factor in zip(starts, raised, strict=True)
        )
        return [Candidate(scored, columns(*starts), fitted=term, traded=traded)]


class _ScoredInductance(InductanceSaturation):
    """Prototype that leaves the inductance at the usual current unchanged."""

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        own = values.fall, values.exponent, values.leakage
        usual = self._remaining(self.reference / _REFERENCE, *own)
        return super().factor(signals, states, values) / usual
