"""Cogging and other torque that is periodic in the shaft angle, as a Fourier series."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import casadi as ca
import numpy as np

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.orders import HIGHEST_ORDER
from identification.effects.parameters import amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractTerm,
    AbstractTorque,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["CoggingTorque"]

_USUAL: Final = 2
_MOST: Final = 5
"""Number of harmonics at first, and the largest number."""

_RETURNS: Final = (30.0, 10.0, 3.0, 1.0)
"""Correction rates of the simulated angle in the continuation steps, times the record length."""

_PINNED: Final = 1e-6
"""Prior standard deviation of the initial simulated angle, which is zero [rad]."""


@register
@dataclass(frozen=True)
class CoggingTorque(AbstractEffect, AbstractTorque):
    """Torque periodic in the shaft angle phi, from slots and poles or from a bent shaft.

        tau = sum_h A_h sin(h k phi) + B_h cos(h k phi)                     [N m]

    The order k is the number of periods per revolution.  If the angle is logged from a mark on the
    shaft, the amplitudes are common to all runs.  If it is counted from the start of a run, or only
    integrated from the speed, its zero is unknown: the amplitudes are then free in each record, as
    constant states.

    An angle integrated from a noisy speed drifts from the true angle as a random walk, further in
    longer records.  Once the order is known, the angle simulated by the model is more accurate.

    Args:
        torque_size: Torque scale [N m].
        logged: Whether the angle is logged, from the same zero in all runs.
        harmonics: Number of multiples h of the order.
        angle: Source of phi: ``read`` from an encoder or ``integrated`` from the logged speed, as
            in the record, or ``simulated`` as a state of the model.
        duration: Duration of the longest record; zero if the angle is read [s].
        recall: Rate at which a simulated angle is corrected towards the integrated one [1/s].
    """

    torque_size: float
    logged: bool = True
    harmonics: int = 2
    angle: Literal["read", "integrated", "simulated"] = "read"
    duration: float = 0.0
    recall: float = 0.0

    name = "cogging_torque"
    equation = "mechanical"
    drivers = ("position",)
    source = (
        "Jahns and Soong, IEEE Trans. Industrial Electronics 43 (1996), 321-330 (pulsating torque)"
    )

    @property
    def variant(self) -> str:
        """Source of the angle and, if not two, the number of harmonics."""
        zero = "common phase of all runs" if self.logged else "separate phase in each run"
        if self.angle == "simulated":
            zero = "simulated angle, separate phase in each run"
        return zero if self.harmonics == _USUAL else f"{zero}, {self.harmonics} harmonics"

    @property
    def richer(self) -> tuple[CoggingTorque, ...]:
        """Extended variants: a simulated instead of an integrated angle, and one more harmonic."""
        forms = []
        if self.angle == "integrated":
            forms.append(replace(self, angle="simulated"))
        if self.harmonics < _MOST:
            forms.append(replace(self, harmonics=self.harmonics + 1))
        return tuple(forms)

    def leads(self, before: AbstractTerm) -> tuple[CoggingTorque, ...]:
        """Continuation steps to a simulated angle, corrected ever less towards the integrated one.

        Without correction, a fit whose simulated speed is slightly off would lose count of the
        revolutions at once.
        """
        is_new = isinstance(before, CoggingTorque) and before.angle != self.angle
        rates = [turns / self.duration for turns in _RETURNS] if is_new else []
        return tuple(replace(self, recall=rate) for rate in rates)

    @property
    def _amplitudes(self) -> dict[str, str]:
        """Names and meanings of the amplitudes."""
        named = {
            "sine": "amplitude of the sine at the order",
            "cosine": "amplitude of the cosine at the order",
        }
        for h in range(2, self.harmonics + 1):
            named[f"sine_{h}"] = f"amplitude of the sine at {h} times the order"
            named[f"cosine_{h}"] = f"amplitude of the cosine at {h} times the order"
        return named

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The order and, if the angle is logged, the amplitudes."""
        order = shape("order", "-", "number of periods per revolution", 0.5, 2.0 * HIGHEST_ORDER)
        amplitudes = tuple(
            amplitude(name, "N m", meaning, self.torque_size, signed=True)
            for name, meaning in self._amplitudes.items()
        )
        return (order, *amplitudes) if self.logged else (order,)

    @property
    def states(self) -> tuple[State, ...]:
        """Per-record amplitudes, if no common zero is logged, and the simulated angle.

        The angle starts at zero, since the amplitudes of each record already contain its phase.
        """
        size = self.torque_size
        names = () if self.logged else self._amplitudes
        amplitudes = tuple(State(name, "N m", scale=size, is_own=True) for name in names)
        turned = State("angle", "rad", scale=_PINNED)
        return (*amplitudes, turned) if self.angle == "simulated" else amplitudes

    def expecting(self, size: float) -> CoggingTorque:
        """The term with this prior standard deviation of the per-record amplitudes [N m]."""
        return replace(self, torque_size=size)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Zero for the amplitudes; corrected speed for the simulated angle [rad/s]."""
        still = super().rates(signals, states, values)
        if self.angle != "simulated":
            return still
        return [*still[:-1], signals.speed + self.recall * (signals.angle - states.angle)]

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque at the angle [N m]."""
        turned = states.angle if self.angle == "simulated" else signals.angle
        angle = values.order * turned
        once, along = ca.sin(angle), ca.cos(angle)
        own = values if self.logged else states
        sine, cosine, torque = once, along, own.sine * once + own.cosine * along
        for h in range(2, self.harmonics + 1):
            sine, cosine = sine * along + cosine * once, cosine * along - sine * once
            torque += getattr(own, f"sine_{h}") * sine + getattr(own, f"cosine_{h}") * cosine
        return torque

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """Starts at the orders 1 to 36 and those of the residual, sine and cosine scored together.

        A logged angle gives two candidates: amplitudes common to all runs, and per-record
        amplitudes.  An integrated angle gives only the latter.
        """
        revolutions = max(float(np.ptp(r.column("angle"))) for r in scales.records) / (2 * np.pi)
        if revolutions < 0.5:
            return []
        size = 0.05 * scales.torque
        starts = [
            (float(order), *phase, *[0.0] * (2 * (_USUAL - 1)))
            for order in (*range(1, HIGHEST_ORDER + 1), *scales.orders)
            for phase in ((size, 0.0), (0.0, size))
        ]
        scanned = cls(scales.torque, logged=True)
        fitted = [cls(scales.torque, False, angle="integrated", duration=scales.duration)]
        if scales.angle_logged:
            fitted = [scanned, cls(scales.torque, False)]
        return [Candidate(scanned, columns(*starts), joint=2, fitted=form) for form in fitted]
