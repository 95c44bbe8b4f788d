"""Voltage sag by the supply resistance of a chopper whose commanded voltage is logged."""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, columns
from identification.effects.parameters import amplitude
from identification.model.parameter import Parameter
from identification.model.term import AbstractVoltage, Expression, Signals, Values

__all__ = ["SupplySag"]


@dataclass(frozen=True)
class SupplySag(AbstractEffect, AbstractVoltage):
    """Voltage sag by the supply resistance of a chopper, if the commanded voltage v is logged.

        voltage = -R_s (v / v_0)^2 i                                        [V]

    A chopper with duty d = v / V draws the current d i from a supply of voltage V and resistance R.
    The supply voltage falls by R d i, and the motor's voltage by R d^2 i.  At full duty this is a
    resistance in series with the armature; at low duty it vanishes.  Runs at several voltages
    therefore separate R_s from Ra.  V is not logged: R_s is the equivalent resistance at v_0.

    Args:
        voltage_size: Voltage scale v_0 [V].
        resistance_size: Resistance scale, that of the armature [ohm].
    """

    voltage_size: float
    resistance_size: float

    name = "unlisted"
    equation = "electrical"
    drivers = ("voltage", "current")
    source = (
        "Erickson and Maksimovic, Fundamentals of Power Electronics (2001), chapter 3 (dc "
        "transformer model of a converter)"
    )

    @property
    def variant(self) -> str:
        """The law in words."""
        return "voltage sag of the supply of a chopper"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The resistance R_s at v_0."""
        meaning = f"equivalent resistance of the supply at {self.voltage_size:.3g} V"
        return (amplitude("resistance", "ohm", meaning, self.resistance_size),)

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Voltage of the sag, opposite to the current [V]."""
        return -values.resistance * (signals.voltage / self.voltage_size) ** 2 * signals.current

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate."""
        size = scales.nominal("Ra25")
        return [Candidate(cls(scales.voltage, size), columns((0.05 * size,)))]
