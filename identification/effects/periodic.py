"""Effects that are periodic in the shaft angle, as a Fourier series of unknown order."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Literal, Self

import casadi as ca
import numpy as np

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.orders import HIGHEST_ORDER
from identification.effects.parameters import amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["AbstractPeriodic", "CoggingTorque"]

_USUAL: Final = 2
_MOST: Final = 5
"""Number of harmonics at first, and the largest number."""

_START: Final = 0.05
"""Amplitude at the start, over its scale [-]."""

_PINNED: Final = 1e-6
"""Prior standard deviation of the initial simulated angle, which is zero [rad]."""

_TINY: Final = 1e-12
"""Square of a phase that turns sin(x) / x into 1 to the last digit but one [rad^2]."""


@dataclass(frozen=True, kw_only=True)
class AbstractPeriodic(AbstractEffect):
    """Quantity periodic in the shaft angle phi, as the torque of `CoggingTorque`."""

    unit: ClassVar[str]
    """Unit of the amplitudes."""

    logged: bool = True
    """True if the angle is logged, from the same zero in all runs."""
    harmonics: int = 2
    """Number of multiples h of the order."""
    angle: Literal["read", "integrated", "simulated"] = "read"
    """Source of phi: ``read`` from an encoder or ``integrated`` from the logged speed, as in the
    record, or ``simulated`` as a state of the model, for predictions."""

    @property
    @abstractmethod
    def size(self) -> float:
        """Scale of the amplitudes in their unit."""

    @property
    def variant(self) -> str:
        """Source of the angle and, if not two, the number of harmonics."""
        zero = "common phase of all runs" if self.logged else "separate phase in each run"
        if self.angle == "simulated":
            zero = "simulated angle, separate phase in each run"
        return zero if self.harmonics == _USUAL else f"{zero}, {self.harmonics} harmonics"

    @property
    def richer(self) -> tuple[Self, ...]:
        """The extended variant with one more harmonic."""
        more = replace(self, harmonics=self.harmonics + 1)
        return (more,) if self.harmonics < _MOST else ()

    @property
    def _amplitudes(self) -> dict[str, str]:
        """Names and meanings of the amplitudes."""
        named = {}
        for h in range(1, self.harmonics + 1):
            suffix, at = (f"_{h}", f"{h} times the order") if h > 1 else ("", "the order")
            for wave in ("sine", "cosine"):
                named[wave + suffix] = f"amplitude of the {wave} at {at}"
        return named

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        order = shape("order", "-", "number of periods per revolution", 0.5, 2.0 * HIGHEST_ORDER)
        amplitudes = tuple(
            amplitude(name, self.unit, meaning, self.size, signed=True)
            for name, meaning in self._amplitudes.items()
        )
        return (order, *amplitudes) if self.logged else (order,)

    @property
    def states(self) -> tuple[State, ...]:
        """Per-record amplitudes, if no common zero is logged, and the simulated angle.

        The angle starts at zero, since the amplitudes of each record already contain its phase.
        """
        names = () if self.logged else self._amplitudes
        amplitudes = tuple(State(name, self.unit, scale=self.size, is_own=True) for name in names)
        turned = State("angle", "rad", scale=_PINNED)
        return (*amplitudes, turned) if self.angle == "simulated" else amplitudes

    @property
    def predicting(self) -> Self:
        """The law with a simulated angle in place of an integrated one."""
        return replace(self, angle="simulated") if self.angle == "integrated" else self

    @property
    def tracked(self) -> tuple[tuple[str, str], ...]:
        names = tuple(self._amplitudes)
        waves = tuple(zip(names[::2], names[1::2], strict=True))
        return waves if self.angle == "integrated" else ()

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Zero for the amplitudes; the speed for the simulated angle [rad/s]."""
        still = super().rates(signals, states, values)
        return still if self.angle != "simulated" else [*still[:-1], signals.speed]

    def wave(
        self, signals: Signals, states: Values, values: Values, turn: Expression | None = None
    ) -> Expression:
        """The sum at the angle, or its average over an integration step that turns it by `turn`.

        The average of sin(h k phi) over a change of the angle by D is the value at its middle times
        sin(x) / x, x = h k D / 2.  Without it, a shaft that turns by several periods in a sample
        interval would need as many substeps.
        """
        angle = values.order * (states.angle if self.angle == "simulated" else signals.angle)
        once, along = ca.sin(angle), ca.cos(angle)
        own = values if self.logged else states
        sine, cosine, total = once, along, ca.SX(0)
        for h in range(1, self.harmonics + 1):
            if h > 1:
                sine, cosine = sine * along + cosine * once, cosine * along - sine * once
            a, b = ("sine", "cosine") if h == 1 else (f"sine_{h}", f"cosine_{h}")
            wave = getattr(own, a) * sine + getattr(own, b) * cosine
            total += wave if turn is None else wave * _averaging(0.5 * h * values.order * turn)
        return total

    @classmethod
    def _scanned(cls, scales: CampaignScales, scanned: Self) -> list[Candidate]:
        """Starts at the orders 1 to 36 and those of the residual, sine and cosine scored together.

        A logged angle gives two candidates: amplitudes common to all runs, and per-record
        amplitudes.  An integrated angle gives only the latter.
        """
        revolutions = max(float(np.ptp(r.column("angle"))) for r in scales.records) / (2 * np.pi)
        if revolutions < 0.5:
            return []
        size = _START * scanned.size
        starts = [
            (float(order), *phase, *[0.0] * (2 * (_USUAL - 1)))
            for order in (*range(1, HIGHEST_ORDER + 1), *scales.orders)
            for phase in ((size, 0.0), (0.0, size))
        ]
        fitted = [replace(scanned, logged=False, angle="integrated")]
        if scales.angle_logged:
            fitted = [scanned, replace(scanned, logged=False)]
        return [Candidate(scanned, columns(*starts), joint=2, fitted=form) for form in fitted]


@register
@dataclass(frozen=True)
class CoggingTorque(AbstractPeriodic, AbstractTorque):
    """Torque periodic in the shaft angle phi, from slots and poles or from a bent shaft.

        tau = sum_h A_h sin(h k phi) + B_h cos(h k phi)                     [N m]

    The order k is the number of periods per revolution.  If the angle is logged from a mark on the
    shaft, the amplitudes are common to all runs.  If it is counted from the start of a run, or only
    integrated from the speed, its zero is unknown: the amplitudes are then free in each record, as
    constant states.

    An angle integrated from a noisy speed drifts from the true angle as a random walk, further in
    longer records.  The drift is estimated from the torque itself (order tracking).
    """

    torque_size: float
    """Torque scale [N m]."""

    name = "cogging_torque"
    amplitude_scale = "torque_size"
    unit = "N m"
    drivers = ("position",)
    source = (
        "Jahns and Soong, IEEE Trans. Industrial Electronics 43 (1996), 321-330 (pulsating torque)"
    )

    @property
    def size(self) -> float:
        return self.torque_size

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque at the angle, or its average over an integration step about it [N m]."""
        # The speed moves a simulated angle within the step, so the state shows no average.
        turn = None if self.angle == "simulated" else signals.turn
        return self.wave(signals, states, values, turn)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls._scanned(scales, cls(scales.torque))


def _averaging(x: Expression) -> Expression:
    """sin(x) / x, also at zero."""
    size = ca.sqrt(x * x + _TINY)
    return ca.sin(size) / size
