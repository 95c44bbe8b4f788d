"""The declared equations with any terms added, as CasADi expressions.

`MotorModel(terms)` is the one place where the right-hand side is put together; simulation,
sensitivities, the filter and the printed equations are all derived from what stands here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Final, Literal

import casadi as ca

from identification.model.declared import DECLARED, coefficient_at, current_rate, speed_rate
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractDelay,
    AbstractHold,
    AbstractMean,
    AbstractSensor,
    AbstractSupply,
    AbstractTemperature,
    AbstractTerm,
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)
from identification.model.unlogged import Unlogged

__all__ = ["CHANNELS", "INPUTS", "Hold", "MotorModel"]

Hold = Literal["zoh", "foh"]

CHANNELS: Final = ("current", "speed")
"""Logged channels, in the order of the columns of `Record.measured`."""

INPUTS: Final = (
    "interval",
    "voltage",
    "voltage_next",
    "temperature",
    "temperature_next",
    "angle",
    "angle_next",
    "time",
    "run",
    "peak_temperature",
    "part",
    "parts",
    "temperature_rate",
)
"""Inputs of one sample interval, in the order of the columns of `Record.inputs`.

A sample interval may be computed in equal parts (`division.py`); `part` counts them from zero."""


@dataclass(frozen=True)
class MotorModel:
    """The declared model with terms added.

    Args:
        terms: What is added to the declared equations.
        hold: Behaviour of the voltage between samples.
        unlogged: Runs whose temperature is a parameter.
    """

    terms: tuple[AbstractTerm, ...] = ()
    hold: Hold = "zoh"
    unlogged: Unlogged = Unlogged()

    def adding(self, *terms: AbstractTerm) -> MotorModel:
        """This model with more terms."""
        return replace(self, terms=(*self.terms, *terms))

    def without(self, name: str) -> MotorModel:
        """This model without the term of that name."""
        return replace(self, terms=tuple(term for term in self.terms if term.name != name))

    @property
    def held(self) -> Hold:
        """Behaviour of the voltage between samples, with the terms that turn it round."""
        turned = sum(isinstance(term, AbstractHold) for term in self.terms) % 2
        other: Hold = "foh" if self.hold == "zoh" else "zoh"
        return other if turned else self.hold

    @property
    def delays(self) -> tuple[AbstractDelay, ...]:
        """The terms that delay a channel."""
        return tuple(term for term in self.terms if isinstance(term, AbstractDelay))

    @property
    def averaged(self) -> tuple[int, ...]:
        """The channels that log means over sample intervals: 0 for the current, 1 for the speed."""
        means = [term.channel for term in self.terms if isinstance(term, AbstractMean)]
        return tuple(k for k, channel in enumerate(CHANNELS) if channel in means)

    @property
    def advance(self) -> int:
        """Samples by which the voltage runs ahead of the log."""
        return sum(int(term.depth) for term in self.delays if term.channel == "voltage")

    @property
    def edges(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Samples at both ends of a record, for each channel, that hang on what is beyond it.

        They are as many as a delay may be long, and one more of a mean.
        """
        first, last = [0, 0], self.advance
        for term in self.delays:
            for k, channel in enumerate(CHANNELS):
                if term.channel in (channel, "voltage"):
                    first[k] = max(first[k], int(term.depth))
        for k in self.averaged:
            first[k] += 1
        return (first[0], last), (first[1], last)

    def lag(self, term: AbstractDelay, parameter: Expression) -> Expression:
        """Delay of the channels of `term` in sample intervals, from all parameters [-]."""
        own = self._values(parameter)[1]
        return term.lag(own[self.terms.index(term)])

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared ones first, then temperatures of runs, then those of each term, term.name."""
        added = [
            replace(parameter, name=f"{term.name}.{parameter.name}")
            for term in self.terms
            for parameter in term.parameters
        ]
        return (*self.unlogged.held(DECLARED), *self.unlogged.parameters, *added)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Current and speed first, then the states of the terms."""
        own = [f"{term.name}.{state.name}" for term in self.terms for state in term.states]
        return ("current", "speed", *own)

    def rates(self, state: Expression, inputs: Expression, parameter: Expression) -> Expression:
        """Right-hand side at the start of a sample interval.

        Args:
            state: (n_state,) symbols.
            inputs: (n_input,) symbols in the order of `INPUTS`.
            parameter: (n_parameter,) symbols.

        Returns:
            (n_state,) time derivatives.
        """
        return self._equations(state, inputs, parameter)[0]

    def logged(self, state: Expression, inputs: Expression, parameter: Expression) -> Expression:
        """Current and speed as the sensors log them, (2,) [A, rad/s]."""
        return self._equations(state, inputs, parameter)[1]

    def _equations(
        self, state: Expression, inputs: Expression, parameter: Expression
    ) -> tuple[Expression, Expression]:
        values, own_values = self._values(parameter)
        own_states = self._own_states(state)
        signals = self._signals(state, inputs, parameter)
        parts = list(zip(self.terms, own_states, own_values, strict=True))

        voltage = signals.voltage
        for term, _, v in parts:
            if isinstance(term, AbstractSupply):
                voltage = term.supplied(voltage, signals, v)
        winding, magnet = _temperatures(parts, signals)
        signals = replace(signals, winding_temperature=winding, magnet_temperature=magnet)

        factor = {name: ca.SX(1) for name in ("Ra", "Kt", "L", "J", "b")}
        torque, lost = ca.SX(0), ca.SX(0)
        for term, s, v in parts:
            if isinstance(term, AbstractCoefficient):
                factor[term.coefficient] *= term.factor(signals, s, v)
            if isinstance(term, AbstractTorque):
                torque += term.torque(signals, s, v)
            if isinstance(term, AbstractVoltage):
                lost += term.voltage(signals, s, v)
        resistance = coefficient_at(values.Ra25, values.alpha_Ra, winding) * factor["Ra"]
        constant = coefficient_at(values.Kt25, values.alpha_Kt, magnet) * factor["Kt"]
        current, speed = signals.current, signals.speed
        rates = [
            current_rate(
                voltage + lost, current, speed, resistance, constant, values.L * factor["L"]
            ),
            speed_rate(
                torque, current, speed, constant, values.b * factor["b"], values.J * factor["J"]
            ),
        ]
        readings = {"current": current, "speed": speed}
        for term, s, v in parts:
            rates += term.rates(signals, s, v)
            if isinstance(term, AbstractSensor):
                readings[term.channel] = term.logged(readings[term.channel], signals, s, v)
        return ca.vertcat(*rates), ca.vertcat(readings["current"], readings["speed"])

    def _signals(self, state: Expression, inputs: Expression, parameter: Expression) -> Signals:
        column = {name: inputs[k] for k, name in enumerate(INPUTS)}
        first = len(DECLARED)
        own = [parameter[first + k] for k in range(len(self.unlogged.parameters))]
        return Signals(
            current=state[0],
            speed=state[1],
            voltage=column["voltage"],
            temperature=self.unlogged.of(column["temperature"], column["run"], own),
            angle=column["angle"],
            time=column["time"],
            run=column["run"],
            peak_temperature=column["peak_temperature"],
            temperature_rate=column["temperature_rate"],
        )

    def _values(self, parameter: Expression) -> tuple[Values, list[Values]]:
        names = [p.name for p in DECLARED]
        declared = {name: parameter[k] for k, name in enumerate(names)}
        own, start = [], len(names) + len(self.unlogged.parameters)
        for term in self.terms:
            named = {p.name: parameter[start + k] for k, p in enumerate(term.parameters)}
            own.append(SimpleNamespace(**declared, **named))
            start += len(term.parameters)
        return SimpleNamespace(**declared), own

    def _own_states(self, state: Expression) -> list[Values]:
        own, start = [], 2
        for term in self.terms:
            own.append(
                SimpleNamespace(**{s.name: state[start + k] for k, s in enumerate(term.states)})
            )
            start += len(term.states)
        return own


def _temperatures(
    parts: Sequence[tuple[AbstractTerm, Values, Values]], signals: Signals
) -> tuple[Expression, Expression]:
    felt = {"winding": signals.temperature, "magnet": signals.temperature}
    for term, s, v in parts:
        if isinstance(term, AbstractTemperature):
            for body in term.bodies_felt:
                felt[body] = term.felt(felt[body], signals, s, v)
    return felt["winding"], felt["magnet"]
