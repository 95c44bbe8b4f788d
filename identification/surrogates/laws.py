"""Physical laws outside the catalogue, which no curve in a signal can represent.

Contacts bend before they slide, so friction reverses over a distance instead of at once (Dahl).  A
bent shaft rubs in one part of the revolution.  The angle may be counted from wherever a run began,
or be integrated from the speed; the phase of this friction is then unknown, so its amplitudes are
free in each record.  A gear or coupling with play disengages when the torque reverses: the rotor
turns alone until it has crossed the play.  A supply sags with the current that a chopper draws.  A
current sensor saturates.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, AbstractForced, CampaignScales, Candidate
from identification.effects.load import AbstractSecondInertia, resonances, share_of_inertia
from identification.effects.parameters import amplitude, columns, shape
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractSensor,
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["AngularFriction", "Backlash", "CurrentSaturation", "DahlFriction", "SupplySag"]

_HARMONICS: Final = 4
_LEVELS: Final = (
    "level",
    *(f"{wave}_{k}" for k in range(1, _HARMONICS + 1) for wave in ("sine", "cosine")),
)
"""Amplitudes of a friction that is periodic in the shaft angle."""
_LEAST_TURNS: Final = 1.0
_STEEP: Final = 3e-3
"""Width of the smoothed sign of the speed, over the speed scale."""
_ROUNDED: Final = 1e-3
"""Width of the smoothed magnitude of the speed, over the speed scale."""
_CORNER: Final = 0.05
"""Width of the rounded corners of the dead zone, over the play."""
_SMALL: Final = 1e-6
"""Current at which a power of its magnitude is smoothed, over the largest current."""
_PLAYS: Final = 12
_CONTACTS: Final = 7


@dataclass(frozen=True)
class AngularFriction(AbstractForced, AbstractTorque):
    """Dry friction whose level is periodic in the shaft angle phi.

    tau = -sign(w) (a_0 + sum_k a_k sin(k phi) + b_k cos(k phi))         [N m]
    """

    torque_size: float
    """Torque scale [N m]."""
    turning: float
    """Speed scale [rad/s]."""
    free: bool = True
    """True if the amplitudes are per-record states; if not, they are parameters, as the score test
    requires."""

    name = "unlisted"
    variant = "Coulomb friction periodic in the shaft angle"
    amplitude_scale = "torque_size"
    drivers = ("position", "speed")
    source = "Priestley, Spectral Analysis and Time Series (1981), section 6.1"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        if self.free:
            return ()
        return tuple(
            amplitude(name, "N m", name, self.torque_size, signed=True) for name in _LEVELS
        )

    @property
    def states(self) -> tuple[State, ...]:
        names = _LEVELS if self.free else ()
        return tuple(State(name, "N m", scale=self.torque_size, is_own=True) for name in names)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        own = states if self.free else values
        level = own.level
        for k in range(1, _HARMONICS + 1):
            level = level + getattr(own, f"sine_{k}") * ca.sin(k * signals.angle)
            level = level + getattr(own, f"cosine_{k}") * ca.cos(k * signals.angle)
        return -level * signals.speed / ca.sqrt(signals.speed**2 + (_STEEP * self.turning) ** 2)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
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
        starts = 0.05 * scales.torque * np.eye(len(_LEVELS))
        return [Candidate(cls(*shared, False), starts, joint=len(_LEVELS), fitted=cls(*shared))]


@dataclass(frozen=True)
class DahlFriction(AbstractEffect, AbstractTorque):
    """Dahl friction: a torque that follows the direction of the motion over a distance d.

    tau = -T z,   dz/dt = (w - |w| z) / d                               [N m]
    """

    torque_size: float
    """Torque scale [N m]."""
    speed_size: float
    """Speed scale [rad/s]."""
    nearest: float
    """Shortest distance that the sampling resolves [rad]."""
    farthest: float
    """Longest distance that a record resolves [rad]."""

    name = "unlisted"
    variant = "Dahl friction"
    drivers = ("speed",)
    source = "Dahl, AIAA Journal 14 (1976), 1675-1682"
    states = (State("deflection", "-", scale=1.0, fades=True),)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            amplitude("torque", "N m", "friction torque in sliding", self.torque_size),
            shape(
                "distance", "rad", "presliding distance d in the formula", self.nearest,
                self.farthest,
            ),
        )  # fmt: skip

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.torque * states.deflection

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        speed = signals.speed
        size = ca.sqrt(speed * speed + (_ROUNDED * self.speed_size) ** 2)
        return [(speed - size * states.deflection) / values.distance]

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        nearest = 0.3 * scales.speed * scales.interval
        farthest = 0.3 * scales.speed * scales.duration
        if farthest < 10 * nearest:
            return []
        scanned = np.geomspace(2 * nearest, farthest / 3, 5)
        starts = [(0.05 * scales.torque, float(d)) for d in scanned]
        return [Candidate(cls(scales.torque, scales.speed, nearest, farthest), columns(*starts))]


@dataclass(frozen=True)
class Backlash(AbstractSecondInertia):
    """Second inertia behind backlash.

        a = w_0^2 d(theta) + 2 z w_0 d'(theta) (w - w_2)

    d is the dead zone: the twist theta beyond the play, with rounded corners.  Its slope d'
    restricts the damping to contact.
    """

    slowest: float
    """Lowest natural frequency in contact [rad/s]."""
    fastest: float
    """Highest resonance that the sampling resolves [rad/s]."""
    narrowest: float
    """Smallest play that is distinguishable from none [rad]."""
    widest: float
    """Largest play that is crossed within a record [rad]."""

    name = "unlisted"
    variant = "backlash"
    drivers = ("speed", "position")
    source = "Nordin and Gutman, Automatica 38 (2002), 1633-1649"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            share_of_inertia("fraction of the inertia J behind the backlash"),
            shape("play", "rad", "width of the backlash", self.narrowest, self.widest),
            shape("resonance", "rad/s", "natural frequency in contact", self.slowest, self.fastest),
            shape("damping", "-", "damping ratio in contact", 0.02, 3.0),
        )

    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        half, corner = values.play / 2, _CORNER * values.play
        above, below = twist - half, twist + half
        far, near = ca.sqrt(above**2 + corner**2), ca.sqrt(below**2 + corner**2)
        beyond = twist + (far - near) / 2
        slope = 1 + (above / far - below / near) / 2
        return values.resonance * (values.resonance * beyond + 2 * values.damping * slope * slip)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its play scanned with a contact nearly as stiff as the sampling resolves.

        The motion after an impact is sensitive to all parameters, so a fit converges only from
        nearby: the refit tries a grid of starting points.
        """
        reach = resonances(scales)
        narrowest = 0.1 * scales.speed * scales.interval
        widest = scales.speed * scales.duration
        if reach is None or widest < 100 * narrowest:
            return []
        slowest, fastest = reach
        scanned = np.geomspace(5 * narrowest, widest / 10, 8)
        starts = [(s, play, 0.4 * fastest, 0.5) for s in (0.2, 0.5) for play in scanned]
        plays = np.geomspace(3 * narrowest, widest / 20, _PLAYS)
        contacts = np.geomspace(2 * slowest, 0.5 * fastest, _CONTACTS)
        tried = columns(*product((0.2, 0.4, 0.6), plays, contacts, (0.1, 0.4, 1.2)))
        term = cls(slowest, fastest, narrowest, widest)
        return [Candidate(term, columns(*starts), tried=tried)]


@dataclass(frozen=True)
class SupplySag(AbstractEffect, AbstractVoltage):
    """Voltage sag by the supply resistance of a chopper, if the commanded voltage v is logged.

        voltage = -R_s (v / v_0)^2 i                                        [V]

    A chopper with duty d = v / V draws the current d i from a supply of voltage V and resistance R.
    The supply voltage falls by R d i, and the motor's voltage by R d^2 i.  At full duty this is a
    resistance in series with the armature; at low duty it vanishes.  Runs at several voltages
    therefore separate R_s from Ra.  V is not logged: R_s is the equivalent resistance at v_0.
    """

    voltage_size: float
    """Voltage scale v_0 [V]."""
    resistance_size: float
    """Resistance scale, that of the armature [ohm]."""

    name = "unlisted"
    variant = "voltage sag of the supply of a chopper"
    drivers = ("voltage", "current")
    source = (
        "Erickson and Maksimovic, Fundamentals of Power Electronics (2001), chapter 3 (dc "
        "transformer model of a converter)"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"equivalent resistance of the supply at {self.voltage_size:.3g} V"
        return (amplitude("resistance", "ohm", meaning, self.resistance_size),)

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.resistance * (signals.voltage / self.voltage_size) ** 2 * signals.current

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        size = scales.nominal("Ra25")
        return [Candidate(cls(scales.voltage, size), columns((0.05 * size,)))]


@dataclass(frozen=True)
class CurrentSaturation(AbstractEffect, AbstractSensor):
    """Current sensor that saturates, as an amplifier or a magnetic core near its limit.

        logged current = i / (1 + c |i / i_0|^2p)^(1/2p)                    [A]

    Voltage and torque both rise faster than the logged current: a brush drop and a saturated flux
    bend them the other way.  The exponent p is large for a sudden limit.
    """

    current_size: float
    """Largest logged current i_0 [A]."""

    name = "unlisted"
    variant = "saturation of the current sensor"
    drivers = ("current",)
    channel = "current"
    source = (
        "Rapp, Proc. 2nd European Conference on Satellite Communications (1991), 179-184 "
        "(amplifier model)"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"saturation at {self.current_size:.3g} A, c in the formula"
        return (
            amplitude("saturation", "-", meaning, 1.0),
            shape("sharpness", "-", "exponent p in the formula", 0.5, 8.0),
        )

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        current, twice = signals.current, 2 * values.sharpness
        size = ca.sqrt((current / self.current_size) ** 2 + _SMALL**2)
        gain = (1 + values.saturation * size**twice) ** (-1 / twice)
        return before + current * (gain - 1)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        largest = max(float(np.abs(record.measured[:, 0]).max()) for record in scales.records)
        return [Candidate(cls(largest), columns((0.1, 1.0), (0.1, 2.5)))]
