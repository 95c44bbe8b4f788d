"""Resistance of the supply behind a chopped voltage that is logged as commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from identification.effects.effect import Candidate, Survey, amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractVoltage, Expression, Signals, Values

__all__ = ["SupplySag"]


@dataclass(frozen=True)
class SupplySag(AbstractVoltage):
    """A supply that sags behind a chopper, where the voltage is logged as it was commanded.

        v = -R_s (v / v_0)^2 i                                              [V]

    The chopper draws the share d = v / V of the current from the supply of voltage V, which falls
    by R d i, and passes the share d of that on: R d^2 i.  At full duty that is a resistance in
    series with the armature, at low duty none, so that voltages of several sizes tell the two
    apart.  V is not logged: R_s is the resistance at the natural voltage v_0.

    Args:
        voltage_size: Natural voltage v_0 [V].
        resistance_size: Natural resistance, that of the armature [ohm].
    """

    voltage_size: float
    resistance_size: float

    name: ClassVar[str] = "unlisted"
    equation: ClassVar[str] = "electrical"
    drivers: ClassVar[tuple[str, ...]] = ("voltage", "current")
    source: ClassVar[str] = (
        "Erickson and Maksimovic, Fundamentals of Power Electronics (2001), chapter 3 (dc "
        "transformer model of a converter)"
    )

    @property
    def variant(self) -> str:
        """Its signals, in words."""
        return "supply that sags behind a commanded voltage"

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The resistance at the natural voltage."""
        meaning = f"resistance of the supply at {self.voltage_size:.3g} V"
        return (amplitude("resistance", "ohm", meaning, self.resistance_size),)

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The voltage lost [V]."""
        return -values.resistance * (signals.voltage / self.voltage_size) ** 2 * signals.current

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure."""
        size = float(survey.values[0])
        return [Candidate(cls(survey.voltage, size), columns((0.05 * size,)))]
