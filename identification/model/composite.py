"""Motor model as CasADi expressions: the nominal equations with added terms.

`MotorModel(terms)` is the only place that assembles the right-hand side.  The simulation, the
sensitivities, the filter and the printed equations are all derived from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
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
    AbstractSampleFilter,
    AbstractSensor,
    AbstractSupply,
    AbstractTemperature,
    AbstractTerm,
    AbstractTorque,
    AbstractTransmission,
    AbstractVoltage,
    AbstractVoltageFilter,
    Expression,
    Signals,
    Values,
)
from identification.model.unlogged import Unlogged

__all__ = ["CHANNELS", "INPUTS", "Edges", "Hold", "MotorModel"]

Hold = Literal["zoh", "foh", "late"]
"""Zero-order hold, first-order hold, or the voltage of the interval that ends at a sample."""

Edges = tuple[tuple[int, int], tuple[int, int]]
"""For current and speed, numbers of samples at the start and at the end of a record."""


CHANNELS: Final = ("current", "speed")
"""Logged channels, in the column order of `Record.measured`."""

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
    "substep",
    "substeps",
    "temperature_rate",
    "turn",
)
"""Inputs of one sample interval, in the column order of `Record.inputs`.

`turn` is the change of the angle over the integration step.  A sample interval may be integrated
in several substeps (`substeps.py`): `substeps` is the number of substeps of this length that fill
the interval, `substep` the number of them before this one.  Both are whole numbers, since unequal
substeps come from halving equal ones.
"""


@dataclass(frozen=True)
class MotorModel:
    """Nominal model with added terms."""

    terms: tuple[AbstractTerm, ...] = ()
    hold: Hold = "zoh"
    """Nominal inter-sample behaviour of the voltage (zero- or first-order hold)."""
    unlogged: Unlogged = Unlogged()
    """Runs without a logged temperature, whose temperatures are parameters."""

    def adding(self, *terms: AbstractTerm) -> MotorModel:
        """Return this model with more terms."""
        return replace(self, terms=(*self.terms, *terms))

    def without(self, name: str) -> MotorModel:
        """Return this model without the terms of the given name."""
        return replace(self, terms=tuple(term for term in self.terms if term.name != name))

    @property
    def held(self) -> Hold:
        """Inter-sample behaviour of the voltage; each `AbstractHold` term changes it."""
        if self.voltage_filters:
            return "zoh"
        terms = [term for term in self.terms if isinstance(term, AbstractHold)]
        if any(term.is_late for term in terms):
            return "late"
        other: Hold = "foh" if self.hold == "zoh" else "zoh"
        return other if len(terms) % 2 else self.hold

    @property
    def delays(self) -> tuple[AbstractDelay, ...]:
        """Terms that delay a channel."""
        return tuple(term for term in self.terms if isinstance(term, AbstractDelay))

    @property
    def voltage_filters(self) -> tuple[AbstractVoltageFilter, ...]:
        """Terms that return the terminal voltage from a filtered log."""
        return tuple(term for term in self.terms if isinstance(term, AbstractVoltageFilter))

    @property
    def averaged(self) -> dict[int, AbstractMean]:
        """Term by index of the channels that log averages: 0 for the current, 1 for the speed."""
        means = {term.channel: term for term in self.terms if isinstance(term, AbstractMean)}
        return {k: means[channel] for k, channel in enumerate(CHANNELS) if channel in means}

    @property
    def sample_filters(self) -> tuple[AbstractSampleFilter, ...]:
        """Digital filters of the samples of a channel."""
        return tuple(term for term in self.terms if isinstance(term, AbstractSampleFilter))

    @property
    def has_history(self) -> bool:
        """True if a reading depends on the states at earlier samples."""
        return bool(self.delays or self.averaged or self.sample_filters)

    @property
    def advance(self) -> int:
        """Number of samples by which the simulation reads the voltage ahead of the log.

        It is negative if it reads the voltage behind the log.
        """
        ahead = sum(term.depth for term in self.delays if term.channel == "voltage")
        return ahead - sum(term.behind for term in self.voltage_filters)

    @property
    def edges(self) -> Edges:
        """Samples at both ends of a record that depend on data outside it, for each channel.

        At the start this is the longest delay, plus the longest average and the memory of a digital
        filter, or the samples by which the voltage is read behind the log.  At the end it is the
        advance of the voltage.
        """
        first, last = [max(-self.advance, 0)] * 2, max(self.advance, 0)
        for term in self.delays:
            for k, channel in enumerate(CHANNELS):
                if term.channel in (channel, "voltage"):
                    first[k] = max(first[k], term.depth)
        for k, mean in self.averaged.items():
            first[k] += mean.intervals
        for digital in self.sample_filters:
            first[CHANNELS.index(digital.channel)] += digital.memory
        return (first[0], last), (first[1], last)

    def own_values(self, term: AbstractTerm, parameter: Expression) -> Values:
        """Parameters of a term, and the nominal ones, by name."""
        return self._values(parameter)[1][self.terms.index(term)]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Nominal parameters, then run temperatures, then the parameters of each term."""
        added = [
            replace(parameter, name=f"{term.name}.{parameter.name}")
            for term in self.terms
            for parameter in term.parameters
        ]
        return (*self.unlogged.held(DECLARED), *self.unlogged.parameters, *added)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Current and speed, then the states of each term (`term.state`)."""
        own = [f"{term.name}.{state.name}" for term in self.terms for state in term.states]
        return ("current", "speed", *own)

    def symbols(self, history: int = 0) -> tuple[Expression, Expression, Expression]:
        """Symbols of the state followed by `history` further values, the inputs, the parameters."""
        state = ca.SX.sym("x", len(self.state_names) + history)
        return state, ca.SX.sym("u", len(INPUTS)), ca.SX.sym("p", len(self.parameters))

    def rates(
        self,
        state: Expression,
        inputs: Expression,
        parameter: Expression,
        *,
        is_averaged: bool = False,
    ) -> Expression:
        """Right-hand side dx/dt of the state equations, (n_state,), from `symbols`.

        With `is_averaged`, torques periodic in the angle are averages over the integration step, in
        which the angle changes by `turn`.
        """
        return _equations_of(self, is_averaged)(state, inputs, parameter)[0]

    def logged(self, state: Expression, inputs: Expression, parameter: Expression) -> Expression:
        """Sensor readings of current and speed before averaging and delay, (2,) [A, rad/s]."""
        return _equations_of(self, False)(state, inputs, parameter)[1]

    def assembled(
        self,
        state: Expression,
        inputs: Expression,
        parameter: Expression,
        *,
        is_averaged: bool = False,
    ) -> tuple[Expression, Expression]:
        """Right-hand side and sensor readings; see `rates` and `logged`."""
        values, own_values = self._values(parameter)
        own_states = self._own_states(state)
        signals = self._signals(state, inputs, parameter)
        if is_averaged:
            signals = replace(signals, turn=inputs[INPUTS.index("turn")])
        parts = list(zip(self.terms, own_states, own_values, strict=True))

        voltage = signals.voltage
        for term, _, v in parts:
            if isinstance(term, AbstractSupply):
                voltage = term.supplied(voltage, signals, v)
        winding, magnet = _temperatures(parts, signals)
        signals = replace(signals, winding_temperature=winding)

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
        inertia = values.J * factor["J"]
        current, speed = signals.current, signals.speed
        motor = constant * current
        signals = replace(signals, resistance=resistance, inertia=inertia, motor_torque=motor)
        net = motor - values.b * factor["b"] * speed + torque
        torque += sum(
            term.loss(net, signals, v)
            for term, _, v in parts
            if isinstance(term, AbstractTransmission)
        )
        rates = [
            current_rate(
                voltage + lost, current, speed, resistance, constant, values.L * factor["L"]
            ),
            speed_rate(torque, current, speed, constant, values.b * factor["b"], inertia),
        ]
        readings = {"current": current, "speed": speed}
        for term, s, v in parts:
            rates += term.rates(signals, s, v)
            if isinstance(term, AbstractSensor):
                readings[term.channel] = term.reading(readings[term.channel], signals, s, v)
        return ca.vertcat(*rates), ca.vertcat(readings["current"], readings["speed"])

    def _signals(self, state: Expression, inputs: Expression, parameter: Expression) -> Signals:
        # Splitting a vector once takes less time than taking its elements one by one.
        column: dict[str, Expression] = dict(zip(INPUTS, ca.vertsplit(inputs), strict=True))
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
            voltage_change=column["voltage_next"] - column["voltage"],
            interval=column["interval"] * column["substeps"],
        )

    def _values(self, parameter: Expression) -> tuple[Values, list[Values]]:
        parts = iter(ca.vertsplit(parameter))
        declared = {p.name: next(parts) for p in DECLARED}
        for _ in self.unlogged.parameters:
            next(parts)
        own = [{p.name: next(parts) for p in term.parameters} for term in self.terms]
        return SimpleNamespace(**declared), [SimpleNamespace(**declared, **each) for each in own]

    def _own_states(self, state: Expression) -> list[Values]:
        parts = iter(ca.vertsplit(state)[2:])
        own = [{s.name: next(parts) for s in term.states} for term in self.terms]
        return [SimpleNamespace(**each) for each in own]


@lru_cache
def _equations_of(model: MotorModel, is_averaged: bool) -> ca.Function:  # noqa: FBT001
    """SX function (state, inputs, parameter) -> (rates, readings)."""
    averaged, depends = _averaged_equations(model)
    if is_averaged or not depends:
        return averaged
    symbols = model.symbols()
    return ca.Function("equations", list(symbols), list(model.assembled(*symbols)))


@lru_cache
def _averaged_equations(model: MotorModel) -> tuple[ca.Function, bool]:
    """Equations with averaged torques, and whether they differ from those without."""
    symbols = model.symbols()
    equations = model.assembled(*symbols, is_averaged=True)
    depends = ca.depends_on(ca.vertcat(*equations), symbols[1][INPUTS.index("turn")])
    return ca.Function("equations", list(symbols), list(equations)), bool(depends)


def _temperatures(
    parts: Sequence[tuple[AbstractTerm, Values, Values]], signals: Signals
) -> tuple[Expression, Expression]:
    felt = {"winding": signals.temperature, "magnet": signals.temperature}
    for term, s, v in parts:
        if isinstance(term, AbstractTemperature):
            for body in term.bodies_felt:
                felt[body] = term.felt(body, felt[body], signals, s, v)
    return felt["winding"], felt["magnet"]
