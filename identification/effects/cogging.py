"""Cogging and other torque that is periodic in the shaft angle, as a Fourier series."""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.effect import CampaignScales, Candidate, register
from identification.effects.periodic import AbstractPeriodic
from identification.model.term import AbstractTorque, Expression, Signals, Values

__all__ = ["CoggingTorque"]


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
    equation = "mechanical"
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
