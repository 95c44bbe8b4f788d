"""Dry friction that is periodic in the shaft angle, as a Fourier series per record.

A bent shaft rubs in one part of the revolution.  The angle may be counted from wherever a run
began, or be integrated from the speed.  The phase is then unknown, so the amplitudes are free in
each record.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import AbstractForced, CampaignScales, Candidate, amplitude
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["AngularFriction"]

Array = NDArray[np.float64]

_HARMONICS: Final = 4
_LEAST_TURNS: Final = 1.0
_STEEP: Final = 3e-3
"""Width of the smoothed sign of the speed, over the speed scale."""


@dataclass(frozen=True)
class AngularFriction(AbstractForced, AbstractTorque):
    """Dry friction whose level is periodic in the shaft angle phi.

        tau = -sign(w) (a_0 + sum_k a_k sin(k phi) + b_k cos(k phi))         [N m]

    Args:
        torque_size: Torque scale [N m].
        turning: Speed scale [rad/s].
        free: Whether the amplitudes are per-record states; if not, they are parameters, as the
            score test requires.
    """

    torque_size: float
    turning: float
    free: bool = True

    name: ClassVar[str] = "unlisted"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("position", "speed")
    source: ClassVar[str] = "Priestley, Spectral Analysis and Time Series (1981), section 6.1"

    @property
    def variant(self) -> str:
        """The law in words."""
        return "Coulomb friction periodic in the shaft angle"

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The amplitudes, unless they are per-record states."""
        if self.free:
            return ()
        return tuple(
            amplitude(name, "N m", name, self.torque_size, signed=True) for name in _names()
        )

    @property
    def states(self) -> tuple[State, ...]:  # type: ignore[override]
        """The amplitudes, if they are free in each record."""
        names = _names() if self.free else []
        return tuple(State(name, "N m", scale=self.torque_size, is_own=True) for name in names)

    def expecting(self, size: float) -> AngularFriction:
        """The term with this prior standard deviation of the per-record amplitudes [N m]."""
        return replace(self, torque_size=size)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The torque [N m]."""
        own = states if self.free else values
        level = own.level
        for k in range(1, _HARMONICS + 1):
            level = level + getattr(own, f"sine_{k}") * ca.sin(k * signals.angle)
            level = level + getattr(own, f"cosine_{k}") * ca.cos(k * signals.angle)
        return -level * signals.speed / ca.sqrt(signals.speed**2 + (_STEEP * self.turning) ** 2)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        """Torque of each start along a trajectory, (n_sample, n_start) [N m]."""
        angle = record.column("angle")
        waves = [np.ones(record.rows)]
        for k in range(1, _HARMONICS + 1):
            waves += [np.sin(k * angle), np.cos(k * angle)]
        direction = speed / np.sqrt(speed**2 + (_STEEP * self.turning) ** 2)
        return np.asarray(-(np.column_stack(waves) * direction[:, None]) @ starts)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its amplitudes scored together, if the shaft makes a full revolution."""
        turned = max(float(np.ptp(r.column("angle"))) for r in scales.records) / (2 * np.pi)
        if turned < _LEAST_TURNS:
            return []
        shared = (scales.torque, scales.speed)
        starts = 0.05 * scales.torque * np.eye(len(_names()))
        return [Candidate(cls(*shared, False), starts, joint=len(_names()), fitted=cls(*shared))]


def _names() -> list[str]:
    waves = [f"{wave}_{k}" for k in range(1, _HARMONICS + 1) for wave in ("sine", "cosine")]
    return ["level", *waves]
