"""Abstract model terms, one class per position at which an effect may enter the equations.

A term is a frozen class with parameters and a formula:

    AbstractTorque        torque on the shaft                            [N m]
    AbstractTransmission  loss of torque on its way to the inertia       [N m]
    AbstractVoltage       voltage in the armature circuit                [V]
    AbstractCoefficient   factor on Ra, Kt, L, J or b                    [-]
    AbstractTemperature   effective temperature of winding or magnet     [degC]
    AbstractSupply        terminal voltage that differs from the log     [V]
    AbstractVoltageFilter the same, of a log that a filter has smoothed  [V]
    AbstractSensor        sensor reading that differs from the state     [A] or [rad/s]
    AbstractDelay         delay of a channel relative to the others      [s]
    AbstractMean          average over sample intervals as the reading of a channel
    AbstractSampleFilter  digital filter of the samples of a channel
    AbstractHold          other inter-sample behaviour of the voltage

The first eight have one abstract method each, the formula.  Any term may add states of its own
(`states` and `rates`).  `composite.py` adds terms to the nominal equations through these interfaces
alone, so a new effect is one class in one file.

The methods must work on CasADi symbols: arithmetic, `casadi.exp` and the like, no NumPy
functions and no Python `if` on a signal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca

from identification.arrays import Array
from identification.model.parameter import Parameter

__all__ = [
    "AbstractCoefficient",
    "AbstractDelay",
    "AbstractHold",
    "AbstractMean",
    "AbstractSampleFilter",
    "AbstractSensor",
    "AbstractSupply",
    "AbstractTemperature",
    "AbstractTerm",
    "AbstractTorque",
    "AbstractTransmission",
    "AbstractVoltage",
    "AbstractVoltageFilter",
    "Channel",
    "Equation",
    "Expression",
    "Signals",
    "State",
    "Values",
]

Expression = Any
"""CasADi SX expression; CasADi ships no types."""

Channel = Literal["current", "speed"]
"""Simulated channel, which is a state of the motor and has a sensor."""

Equation = Literal["electrical", "mechanical", "thermal", "sensor"]
"""Part of the model that a term enters."""

Values = SimpleNamespace
"""Symbols by name: the parameters of a term and the nominal ones, or the states of a term."""


@dataclass(frozen=True)
class State:
    """State variable of a term."""

    name: str
    """Name, unique within the term."""
    unit: str
    """Unit, for the report."""
    follows: Literal["temperature", "current", "speed", "zero"] = "zero"
    """Signal that the state equals in steady state, or ``zero``; it sets the prior mean of the
    initial value."""
    scale: float = 30.0
    """Prior standard deviation of the initial value of a state that starts at zero [unit]."""
    is_own: bool = False
    """True if the state is a per-record amplitude: constant, or the initial value of a transient
    that no input drives."""
    fades: bool = False
    """True if the influence of the initial value decays long before the record ends, as in a
    filter; later samples carry no information about it."""


@dataclass(frozen=True)
class Signals:
    """Signals on which a term may depend, at one instant."""

    current: Expression
    """Armature current [A]."""
    speed: Expression
    """Shaft speed [rad/s]."""
    voltage: Expression
    """Logged terminal voltage [V]."""
    temperature: Expression
    """Logged temperature, smoothed [degC]."""
    angle: Expression
    """Logged shaft angle, or the integral of the logged speed [rad]."""
    time: Expression
    """Time since the start of the run [s]."""
    run: Expression
    """Index of the run in the order of recording, from 0 [-]."""
    peak_temperature: Expression
    """Highest temperature logged so far in the campaign [degC]."""
    temperature_rate: Expression = None
    """Time derivative of the logged temperature, smoothed [K/s]."""
    winding_temperature: Expression = None
    """Effective temperature of the winding [degC]."""
    resistance: Expression = None
    """Armature resistance with the factors of all terms [ohm]; known to rates of states only."""
    inertia: Expression = None
    """Inertia of the rotor, with the factors of all terms [kg m^2]; known to the same rates."""
    motor_torque: Expression = None
    """Torque of the motor, Kt i [N m]; known to the same rates and to losses of torque only."""
    turn: Expression = None
    """Change of the angle over a step of the integration, if torques are averaged over it [rad]."""
    voltage_change: Expression = None
    """Change of the logged voltage until the next sample [V]."""
    interval: Expression = None
    """Sample interval, zero at the last sample of a record [s]."""


@dataclass(frozen=True)
class AbstractTerm(ABC):
    """Named term; the module's docstring lists where a term may enter the equations.

    A subclass sets each property to a constant, or computes it from its fields.  Its equation is
    that of the place where it enters; only a factor may belong to any of them.
    """

    name: ClassVar[str]
    equation: ClassVar[Equation]

    @property
    @abstractmethod
    def drivers(self) -> tuple[str, ...]:
        """Signals on which the term depends; none for a constant."""

    @property
    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the term."""

    @property
    def states(self) -> tuple[State, ...]:
        """States of the term; most terms have none."""
        return ()

    @property
    def own_root(self) -> Array | None:
        """R (n, n_state) of the prior of per-record amplitudes a: R a has the variance scale^2.

        None if the amplitudes are independent.
        """
        return None

    @property
    def tracked(self) -> tuple[tuple[str, str], ...]:
        """States with the sine and cosine amplitudes of harmonics 1, 2, ..., for order tracking.

        Empty unless the term depends on an integrated angle; `order` is its periods per revolution.
        """
        return ()

    @property
    def predicting(self) -> AbstractTerm:
        """The term in a prediction, for which current and speed are not known beforehand."""
        return self

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Time derivative of each state of this term, zero by default [unit of the state / s]."""
        return [ca.SX(0)] * len(self.states)


class AbstractTorque(AbstractTerm):
    """Torque on the shaft, positive in the direction of positive speed."""

    equation: ClassVar[Equation] = "mechanical"

    @abstractmethod
    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque added to the right-hand side of J dw/dt = Kt i - b w + ... [N m]."""


class AbstractTransmission(AbstractTerm):
    """Loss of torque between the motor and the inertia, which depends on the torque itself."""

    equation: ClassVar[Equation] = "mechanical"

    @abstractmethod
    def loss(self, net: Expression, signals: Signals, values: Values) -> Expression:
        """Torque added to the sum `net` of all others, J dw/dt without this term [N m]."""


class AbstractVoltage(AbstractTerm):
    """Voltage in the armature circuit."""

    equation: ClassVar[Equation] = "electrical"

    @abstractmethod
    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Voltage added to the right-hand side of L di/dt = v - Ra i - Kt w + ... [V]."""


class AbstractCoefficient(AbstractTerm):
    """Factor on one coefficient of the nominal equations."""

    @property
    @abstractmethod
    def coefficient(self) -> str:
        """Ra, Kt, L, J or b."""

    @abstractmethod
    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Factor on the coefficient; one if the effect is absent [-]."""


class AbstractTemperature(AbstractTerm):
    """Effective temperature of winding or magnet, if it differs from the logged one."""

    equation: ClassVar[Equation] = "thermal"

    @property
    @abstractmethod
    def bodies_felt(self) -> tuple[str, ...]:
        """Bodies with the effective temperature: ``winding``, ``magnet`` or both."""

    @property
    def log_step(self) -> float:
        """Step of a log whose unknown error the term multiplies [K]; zero if it multiplies none."""
        return 0.0

    def log_error(self, time: Array) -> Array | None:
        """(n, n_state) error of the log [K] at times (n,) [s] by a unit of each state, or None."""
        return None

    @abstractmethod
    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Effective temperature of one of `bodies_felt`, given that without this term [degC]."""


class AbstractSupply(AbstractTerm):
    """Terminal voltage, if it differs from the logged one."""

    equation: ClassVar[Equation] = "sensor"

    @abstractmethod
    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        """Terminal voltage, given the one without this term [V]."""


class AbstractVoltageFilter(AbstractSupply):
    """Terminal voltage that a low-pass filter smooths before it is logged.

    The terminal voltage is held between samples.
    """

    behind: int = 0
    """Number of samples by which the simulation reads the voltage behind the log."""


class AbstractSensor(AbstractTerm):
    """Sensor reading, if it differs from the state itself."""

    equation: ClassVar[Equation] = "sensor"
    channel: Channel

    @abstractmethod
    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Reading, given the one without this term [A] or [rad/s]."""


@dataclass(frozen=True)
class AbstractDelay(AbstractTerm):
    """Channel that lags the others by its parameter `delay` [s].

    The reading is that of a step up to the instant before the sample (`history.py`).  A lagging
    voltage is equivalent to both other channels leading: the simulation uses the voltage `depth`
    samples ahead and delays both channels by `depth` minus the delay.
    """

    equation: ClassVar[Equation] = "sensor"

    channel: str
    """The delayed channel; a delay of ``voltage`` is an advance of the two others."""
    depth: int
    """Length of the delay buffer, in samples."""
    interval: float
    """Sample interval [s]."""

    def lag(self, values: Values) -> Expression:
        """Delay of the simulated channels in sample intervals [-]."""
        if self.channel == "voltage":
            return self.depth - values.delay / self.interval
        return values.delay / self.interval


class AbstractMean(AbstractTerm):
    """Channel whose reading is its average over the sample interval that ends there, or several.

    The integral over the interval is an additional state of the integration step, so the average
    is as accurate as the states.  A delay of the same channel delays the average.
    """

    equation: ClassVar[Equation] = "sensor"
    channel: ClassVar[Channel]
    intervals: int = 1
    """Most sample intervals of an average."""

    def window(self, values: Values) -> Expression:  # noqa: ARG002
        """Sample intervals of the average, at most `intervals` [-]."""
        return 1.0


class AbstractSampleFilter(AbstractTerm):
    """Channel whose samples pass a digital filter."""

    equation: ClassVar[Equation] = "sensor"
    channel: ClassVar[Channel]
    memory: int = 1
    """Number of past values that the filter keeps; they equal the logged value at first."""

    @abstractmethod
    def filtered(
        self, sample: Expression, past: Sequence[Expression], values: Values
    ) -> tuple[Expression, Sequence[Expression]]:
        """Reading at a sample, given the past values, and those for the next sample."""


class AbstractHold(AbstractTerm):
    """Inter-sample behaviour of the voltage other than the nominal one."""

    equation: ClassVar[Equation] = "sensor"
    is_late: ClassVar[bool] = False
    """True if a row has the voltage of the interval that ends there; False for an exchange of
    zero- and first-order hold."""
