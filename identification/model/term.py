"""What a model is made of: small terms that say where they enter the equations.

A term is a frozen class: its parameters, the formula, and nothing else.  There is one abstract
class for each place at which physics can enter, and each asks for one method:

    AbstractTorque        a torque on the shaft                          [N m]
    AbstractVoltage       a voltage in the armature loop                 [V]
    AbstractCoefficient   a factor on Ra, Kt, L, J or b                  [-]
    AbstractTemperature   what winding or magnet feel instead of the log [degC]
    AbstractSupply        what the terminals see instead of the log      [V]
    AbstractSensor        what a sensor logs instead of the state        [A] or [rad/s]
    AbstractDelay         a channel that lags the others                 [s]
    AbstractMean          a channel that logs means over sample intervals
    AbstractHold          the other behaviour of the voltage between samples

Any of them may bring states of its own (`states` and `rates`).  `composite.py` adds terms to the
declared equations without knowing a single one, so a new effect is one class in one file.

The methods must work on CasADi symbols: arithmetic, `casadi.exp` and the like, no NumPy
functions and no Python `if` on a signal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca

from identification.model.parameter import Parameter

__all__ = [
    "AbstractCoefficient",
    "AbstractDelay",
    "AbstractHold",
    "AbstractMean",
    "AbstractSensor",
    "AbstractSupply",
    "AbstractTemperature",
    "AbstractTerm",
    "AbstractTorque",
    "AbstractVoltage",
    "Expression",
    "Signals",
    "State",
    "Values",
]

Expression = Any
"""A CasADi SX scalar; CasADi ships no types."""

Values = SimpleNamespace
"""Parameters of the term by name, as symbols, and the declared ones."""


@dataclass(frozen=True)
class State:
    """A state that a term brings.

    Args:
        name: Name, unique within the term.
        unit: Unit, for the report.
        follows: What it equals in steady state at the start of a run (``temperature``,
            ``current``, ``speed``) or ``zero``; the start of the free initial value.
        scale: Width of the broad prior of the initial value of a state that starts at zero [unit].
        is_own: Whether it is an amplitude that each record has for itself: it does not move, or is
            the beginning of a course that no input drives.
        fades: Whether its value at the start is forgotten long before the record ends, as a
            filter's is; samples after that tell nothing of it.
    """

    name: str
    unit: str
    follows: Literal["temperature", "current", "speed", "zero"] = "zero"
    scale: float = 30.0
    is_own: bool = False
    fades: bool = False


@dataclass(frozen=True)
class Signals:
    """What a term may depend on, at one instant.

    Args:
        current: Armature current [A].
        speed: Shaft speed [rad/s].
        voltage: Logged terminal voltage [V].
        temperature: Logged temperature, smoothed [degC].
        angle: Logged shaft angle, or the integral of the logged speed [rad].
        time: Time in the run [s].
        run: Number of the run in the order of recording, from 0 [-].
        peak_temperature: Highest temperature logged so far in the campaign [degC].
        temperature_rate: Time derivative of the logged temperature, smoothed [K/s].
        winding_temperature: What the winding has [degC].
        magnet_temperature: What the magnet has [degC].
    """

    current: Expression
    speed: Expression
    voltage: Expression
    temperature: Expression
    angle: Expression
    time: Expression
    run: Expression
    peak_temperature: Expression
    temperature_rate: Expression = None
    winding_temperature: Expression = None
    magnet_temperature: Expression = None


class AbstractTerm(ABC):
    """A piece of physics with a name; see the module's docstring for its kinds."""

    name: ClassVar[str]
    equation: ClassVar[str]  # electrical, mechanical, thermal or sensor
    drivers: ClassVar[tuple[str, ...]]
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    defining: ClassVar[tuple[str, ...]] = ()  # shapes whose range makes the kind what it is
    moments: ClassVar[tuple[str, ...]] = ()  # times of events, which any sample may be
    laws: ClassVar[tuple[type[AbstractTerm], ...]] = ()  # other classes of the same kind

    @property
    def variant(self) -> str:
        """Which of several terms of this name it is: its channel, run or signals; empty for one."""
        return ""

    @property
    def is_local(self) -> bool:
        """Whether the term belongs to the runs or times where it was seen, and to no other run."""
        return False

    @property
    def richer(self) -> tuple[AbstractTerm, ...]:
        """Better forms of the same law, tried in turn once this one has been found; often none."""
        return ()

    def leads(self, before: AbstractTerm) -> tuple[AbstractTerm, ...]:
        """Forms through which a fit is led from a poorer form to this one; none for most.

        Args:
            before: The poorer form.
        """
        return ()

    def flaw(self, values: Mapping[str, float]) -> str:
        """Why the term is not what its kind is with these values, in words; empty where it is.

        Args:
            values: Its parameters by name.
        """
        return ""

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Time derivative of each state of this term; none moves [unit of the state / s]."""
        return [ca.SX(0)] * len(self.states)


class AbstractTorque(AbstractTerm):
    """A torque on the shaft, positive in the direction of positive speed."""

    @abstractmethod
    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque added to the right-hand side of J dw/dt = Kt i - b w + ... [N m]."""


class AbstractVoltage(AbstractTerm):
    """A voltage in the armature loop."""

    @abstractmethod
    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Voltage added to the right-hand side of L di/dt = v - Ra i - Kt w + ... [V]."""


class AbstractCoefficient(AbstractTerm):
    """A factor on one of the coefficients of the declared equations."""

    coefficient: ClassVar[str]  # Ra, Kt, L, J or b

    @abstractmethod
    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Factor on the coefficient; one where the effect vanishes [-]."""


class AbstractTemperature(AbstractTerm):
    """The temperature of winding or magnet, where it is not the logged one."""

    bodies_felt: ClassVar[tuple[str, ...]]  # of winding and magnet

    @abstractmethod
    def felt(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Temperature of the body, given the one without this term [degC]."""


class AbstractSupply(AbstractTerm):
    """The voltage at the terminals, where it is not the logged one."""

    @abstractmethod
    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        """Voltage at the terminals, given the one without this term [V]."""


class AbstractSensor(AbstractTerm):
    """What a sensor logs, where it is not the state itself."""

    channel: ClassVar[str]  # current or speed

    @abstractmethod
    def logged(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Logged value, given the one without this term [A] or [rad/s]."""


class AbstractDelay(AbstractTerm):
    """A channel that lags the others by its parameter `delay` [s].

    The logged value is that of the model a while ago, taken between samples from the cubic through
    value and slope at both ends of the interval (the slopes jump at samples where the voltage
    does, so a straight line would be off by the curvature of the current).  A voltage that lags
    is the same as both other channels leading: the simulation is driven with the voltage `depth`
    samples ahead and both channels are delayed by the rest.
    """

    channel: Any  # "current", "speed" or "voltage"; a field of the term
    depth: Any  # whole sample intervals kept; a field of the term
    interval: Any  # sample interval [s]; a field of the term

    def lag(self, values: Values) -> Expression:
        """By how much the simulated channels are delayed, in sample intervals [-]."""
        if self.channel == "voltage":
            return self.depth - values.delay / self.interval
        return values.delay / self.interval


class AbstractMean(AbstractTerm):
    """A channel whose logged value is its mean over the sample interval that ends there.

    The integral over the interval is computed with the states, so that the mean is as accurate as
    they are.  A delay of the same channel delays the mean.
    """

    channel: ClassVar[str]  # current or speed


class AbstractHold(AbstractTerm):
    """The voltage between samples behaves the other way than declared."""
