"""Causes of a change between two campaigns of one motor, as directions in parameter space.

A cause changes some parameters together and leaves the others as they are.  Each of its directions
gives the relative changes of the parameters for one unit of change; the size of the change is not
known, its sign is.  The relations follow from the two equations of the nominal model:

    v = Ra i + L di/dt + Kt w        J dw/dt = Kt i - b w - T_c sgn w

A new cause is one class here and its entry in `CAUSES`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

__all__ = ["CAUSES", "AbstractCause", "Direction"]

Direction = Mapping[str, float]
"""Relative change by parameter, or by size of an effect such as ``coulomb_friction.torque`` [-]."""

_COULOMB = "coulomb_friction.torque"
_DROP = "brush_drop.voltage"
_THINNING = "viscous_temperature.rate"


class AbstractCause(ABC):
    """Cause of a change.

    Attributes:
        name: Name in tables.
        meaning: What has happened, for people.
        check: What to check first.
    """

    name: ClassVar[str]
    meaning: ClassVar[str]
    check: ClassVar[str]

    @abstractmethod
    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Directions of the change from these values; parameters not compared are ignored."""


class Demagnetization(AbstractCause):
    """Irreversible loss of flux: Kt25 falls, and the reversible coefficient alpha_Kt remains."""

    name = "demagnetization"
    meaning = "the magnets have lost flux"
    check = "overcurrent and overheating since the last campaign"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Fall of the torque constant alone."""
        return [{"Kt25": -1.0}]


class BrushWear(AbstractCause):
    """Worse contact: a series resistance without the temperature coefficient of copper, or a drop.

    The resistance r adds to Ra25; Ra25 alpha_Ra remains, so alpha_Ra falls as Ra25 rises.
    """

    name = "brush_wear"
    meaning = "worn brushes, or a worse contact of the leads"
    check = "length and pressure of the brushes, terminals"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Series resistance, voltage drop, or both."""
        series = {"Ra25": 1.0, "alpha_Ra": -1.0}
        return [
            series,
            {_DROP: 1.0},
            *({n: share * v for n, v in series.items()} | {_DROP: 1.0} for share in (0.1, 0.5, 2)),
        ]


class BetterContact(AbstractCause):
    """Better contact: the series resistance falls, and alpha_Ra rises."""

    name = "better_contact"
    meaning = "new or bedded brushes, or cleaned contacts"
    check = "whether brushes or leads were changed"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """The directions of brush wear with the opposite sign."""
        worn = BrushWear().directions(before)
        return [{name: -share for name, share in one.items()} for one in worn]


class RunIn(AbstractCause):
    """Run-in of bearings and brushes: dry and viscous friction fall."""

    name = "run_in"
    meaning = "bearings or brushes have run in"
    check = "operating hours since assembly"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Fall of one or both frictions."""
        return [
            {"b": -1.0},
            {_COULOMB: -1.0},
            *({"b": -share, _COULOMB: -1.0} for share in (0.3, 1.0, 3.0)),
        ]


class Grease(AbstractCause):
    """Aged or cold grease: viscous friction and its temperature dependence rise."""

    name = "grease"
    meaning = "aged, stiff or cold grease"
    check = "lubrication, and the temperature of the bearings"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Rise of the viscous friction with its temperature dependence unchanged or steeper."""
        return [{"b": 1.0}, *({"b": 1.0, _THINNING: share} for share in (0.3, 1.0))]


class BearingWear(AbstractCause):
    """Worn or contaminated bearings: dry friction rises, and viscous friction may rise with it."""

    name = "bearing_wear"
    meaning = "worn, dirty or preloaded bearings"
    check = "noise and play of the bearings, alignment of the coupling"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Rise of the dry friction, alone or with the viscous one."""
        return [{_COULOMB: 1.0}, *({_COULOMB: 1.0, "b": share} for share in (0.1, 0.3, 1.0))]


class LoadInertia(AbstractCause):
    """Another coupling or load: the inertia changes alone."""

    name = "load_inertia"
    meaning = "another inertia on the shaft"
    check = "coupling, encoder and load"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Either sign."""
        return _both_signs({"J": 1.0})


class ShortedTurns(AbstractCause):
    """Fewer active turns: Ra25 and Kt25 fall with their number, L with its square."""

    name = "shorted_turns"
    meaning = "shorted turns of the winding"
    check = "insulation and commutator"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Fall with the number of turns."""
        return [{"Ra25": -1.0, "Kt25": -1.0, "L": -2.0}]


class Thermometer(AbstractCause):
    """Another position or calibration of the thermometer.

    With the logged temperature T' = T + c the apparent resistance at 25 degC is
    Ra25 (1 - alpha_Ra c), and Ra25 alpha_Ra remains; likewise for Kt.  A gain divides both
    temperature coefficients.
    """

    name = "thermometer"
    meaning = "another position or calibration of the thermometer"
    check = "where the temperature is measured, also against a second thermometer at rest"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Offset of either sign, scaled to the change of Ra25, and gain of either sign."""
        gain = {"alpha_Ra": 1.0, "alpha_Kt": 1.0}
        winding, magnet = before.get("alpha_Ra"), before.get("alpha_Kt")
        if not winding or magnet is None:
            return _both_signs(gain)
        share = magnet / winding
        offset = {"Ra25": 1.0, "alpha_Ra": -1.0, "Kt25": share, "alpha_Kt": -share}
        return [*_both_signs(offset), *_both_signs(gain)]


class CurrentGain(AbstractCause):
    """Another gain g of the current channel: resistances fall by g, torques per ampere rise."""

    name = "current_gain"
    meaning = "another gain of the current sensor"
    check = "calibration and range of the current sensor"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Either sign; the back-EMF fixes Kt25."""
        return _both_signs({"Ra25": -1.0, "L": -1.0, "J": 1.0, "b": 1.0, _COULOMB: 1.0})


class VoltageGain(AbstractCause):
    """Another gain of the voltage channel: all voltages and, by Kt25, all torques scale with it."""

    name = "voltage_gain"
    meaning = "another gain of the voltage measurement"
    check = "voltage divider, and where the voltage is measured"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Either sign."""
        names = ("Ra25", "Kt25", "L", "J", "b", _COULOMB, _DROP)
        return _both_signs(dict.fromkeys(names, 1.0))


class SpeedGain(AbstractCause):
    """Another gain g of the speed channel: Kt25 and torques fall by g, J and b by its square."""

    name = "speed_gain"
    meaning = "another gain of the speed measurement"
    check = "pulses per turn of the encoder, or the tachometer constant"

    def directions(self, before: Mapping[str, float]) -> list[Direction]:
        """Either sign."""
        return _both_signs({"Kt25": -1.0, "J": -2.0, "b": -2.0, _COULOMB: -1.0})


def _both_signs(direction: Direction) -> list[Direction]:
    return [direction, {name: -share for name, share in direction.items()}]


CAUSES: tuple[AbstractCause, ...] = (
    Demagnetization(),
    BrushWear(),
    BetterContact(),
    RunIn(),
    Grease(),
    BearingWear(),
    LoadInertia(),
    ShortedTurns(),
    Thermometer(),
    CurrentGain(),
    VoltageGain(),
    SpeedGain(),
)
"""All causes in the order of tables; changes of the motor first, of the bench last."""
