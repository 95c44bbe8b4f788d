"""Predicted readings of a candidate run: simulation, limits and sensitivities.

The run starts at rest.  Parameters and initial state are unknown within their covariance, so the
readings of a model are normal with the covariance 1 + G C G' in units of the noise, where G holds
the sensitivities (linearisation at the estimate).

A load acts between the pauses of the profile, with the law of the effect `load_step`.  A fit does
not read it, so its torque and its times are unknown too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.design.models import DesignModel
from identification.design.profiles import pauses
from identification.effects.load import LoadStep
from identification.fit.own_states import state_precision
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import Record, records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.substeps import evenly
from identification.model.tangent import tangent

__all__ = ["Conditions", "Predictor", "Response", "load_shape"]

_EDGE: Final = 2.0
"""Width of an edge of the load, as `load_step` has it [sample]."""
_MOST_SUBSTEPS: Final = 8
_MISSED: Final = 1e-3
"""Part of the peak of the current that its instants may miss [-]."""
_MOST_INSTANTS: Final = 16


@dataclass(frozen=True)
class Response:
    """Readings of a model over a candidate run, in units of the noise."""

    mean: Array
    """(n,) readings of both channels."""
    sensitivity: Array
    """(n, n_parameter + n_other) derivatives by coordinates, load and initial states."""
    covariance: Array
    """(n_parameter + n_other, n_parameter + n_other) before the run."""
    count: int
    """Number of parameters."""

    @cached_property
    def information(self) -> Array:
        """(n_parameter, n_parameter) Fisher information with load and initial states eliminated."""
        n, full = self.count, self.sensitivity.T @ self.sensitivity
        states = full[n:, n:] + np.linalg.inv(self.covariance[n:, n:])
        return np.asarray(full[:n, :n] - full[:n, n:] @ np.linalg.solve(states, full[n:, :n]))


@dataclass(frozen=True)
class Conditions:
    """Conditions that all candidate runs share."""

    interval: float
    """Sample interval [s]."""
    noise: Array
    """(2,) standard deviations of current and speed [A, rad/s]."""
    earlier: int = 0
    """Number of runs recorded before."""
    hottest: float = -np.inf
    """Highest temperature of these runs [degC]."""
    load: float = 0.0
    """Largest load torque; zero if the bench has none [N m]."""

    def record(self, voltage: Array, temperature: float, readings: Array) -> Record:
        """Record of a run with (n_sample,) [V], [degC] and (n_sample, 2) readings [A, rad/s]."""
        run = Run(
            name="design",
            sha256="",
            time=self.interval * np.arange(voltage.size, dtype=np.float64),
            voltage=voltage,
            current=readings[:, 0],
            speed=readings[:, 1],
            temperature=np.full(voltage.size, temperature),
        )
        return records_of([run], self.earlier, self.hottest)[0]


@dataclass(frozen=True)
class Predictor:
    """Simulation of candidate runs with one model."""

    model: DesignModel
    """The model, without the load."""
    conditions: Conditions
    simulator: Simulator
    """Simulator over a reference run, whose step plan and substeps are used."""

    @staticmethod
    def prepared(model: DesignModel, reference: Array, conditions: Conditions) -> Predictor:
        """Predictor with a step plan for a reference voltage (n_sample,) of largest size [V]."""
        record = conditions.record(reference, 25.0, np.zeros((reference.size, 2)))
        motor, load = model.model, conditions.load
        if load > 0.0:
            last = float(record.time[-1])
            term = LoadStep(conditions.earlier, load, _EDGE * conditions.interval, last)
            motor = motor.adding(term)
        draws = _completed(motor, model.draws(8, 0), load, record.time)
        simulator = Simulator.fitting(motor, [record], draws)
        states = [initial_states(motor, record)]
        counts = 1
        if motor.terms:
            values = _completed(motor, model.estimate, load, record.time)
            fine = simulator.accurate(values, states, conditions.noise)
            counts = 1 if fine.substeps is None else round(1.0 / fine.substeps[0].shares.min())
        substeps = evenly([reference.size], min(counts, _MOST_SUBSTEPS))
        simulator = replace(simulator, substeps=None if counts == 1 else substeps)
        return Predictor(model, conditions, simulator)

    def states(self, voltage: Array, temperature: float, values: Array, load: float = 0.0) -> Array:
        """Current and speed of the motor itself, (n_sample, 2, n_lane) [A, rad/s].

        The voltage is (n_sample,) [V], the temperature in degC, the load a torque [N m]; the values
        are physical, (n_parameter, n_lane).
        """
        simulator = self._over(voltage, temperature, load)
        start = initial_states(simulator.model, simulator.records[0])
        return simulator.states(self._all(values, load), [start])[0][:, :2, :]

    def states_between(
        self, voltage: Array, temperature: float, values: Array, load: float = 0.0
    ) -> tuple[Array, float]:
        """The same at equal instants between the samples too, and their distance [s].

        The states are (n_instant, 2, n_lane).  The current of a motor whose electrical time
        constant is short passes its peak between two samples.
        """
        simulator = self._over(voltage, temperature, load)
        start = initial_states(simulator.model, simulator.records[0])
        counts = 1 if simulator.substeps is None else int(simulator.substeps[0].counts[0])
        count = max(counts, self._instants)
        simulator = replace(simulator, substeps=evenly([voltage.size], count))
        values = self._all(values, load)
        states = simulator.states(values, [start], of_substeps=True)[0][:, :2, :]
        return states, self.conditions.interval / count

    @cached_property
    def _instants(self) -> int:
        """Instants per sample interval h that the peak of the current requires.

        Its curvature after a step of the voltage is 1 over the product p of electrical and
        mechanical time constant; n instants miss it by at most h^2 / (8 n^2 p).
        """
        value = dict(zip(self.model.names, self.model.estimate, strict=True))
        product = value["L"] * value["J"] / (value["Ra25"] * value["b"] + value["Kt25"] ** 2)
        needed = self.conditions.interval / np.sqrt(8.0 * _MISSED * product)
        return int(np.clip(np.ceil(needed), 1, _MOST_INSTANTS))

    def response(self, voltage: Array, temperature: float, load: float = 0.0) -> Response:
        """Readings and sensitivities at the estimate, for (n_sample,) [V], [degC] and [N m]."""
        one, size = self.model, self.model.estimate.size
        simulator = self._over(voltage, temperature, load)
        record = simulator.records[0]
        start = initial_states(simulator.model, record)
        values = self._all(one.estimate, load)
        # Torque, start and stop of a load are unknown; without a load there is nothing to know.
        duration = float(record.time[-1])
        unknown = np.array([self.conditions.load, duration, duration] if load else [])
        directions = np.eye(values.size, size + unknown.size)
        directions[:size, :size] = np.diag(one.slopes)
        logged, slopes = tangent(simulator, values, [start], directions)
        # The prior of the initial states is as wide as the signals, as in a fit of the run.
        signals = replace(simulator, records=(replace(record, measured=logged[0]),))
        spreads = [np.zeros(size), unknown**2, 1.0 / state_precision(signals, 0)]
        covariance = np.diag(np.concatenate(spreads))
        covariance[:size, :size] = one.covariance
        weight = np.sqrt(one.fraction * record.weight) / self.conditions.noise
        mean = (logged[0] * weight).ravel()
        sensitivity = (slopes[0] * weight[:, :, None]).reshape(mean.size, -1)
        return Response(mean, sensitivity, covariance, size)

    def _all(self, values: Array, load: float) -> Array:
        """Values of the motor, completed by those of a load torque [N m]."""
        simulator = self.simulator
        return _completed(simulator.model, values, load, simulator.records[0].time)

    def _over(self, voltage: Array, temperature: float, load: float) -> Simulator:
        """Simulator over a candidate run; the angle is that of the simulated shaft."""
        readings = np.zeros((voltage.size, 2))
        simulator = self._with(voltage, temperature, readings)
        if any("position" in term.drivers for term in self.model.model.terms):
            start = initial_states(simulator.model, simulator.records[0])
            values = self._all(self.model.estimate, load)[:, None]
            readings = simulator.states(values, [start])[0][:, :2, 0]
            simulator = self._with(voltage, temperature, readings)
        return simulator

    def _with(self, voltage: Array, temperature: float, readings: Array) -> Simulator:
        record = self.conditions.record(voltage, temperature, readings)
        return replace(self.simulator, records=(record.within(self.model.model.edges),))


def load_shape(rows: int) -> Array:
    """Load over its level (rows,) [-], with the edges of `load_step`; zero at both ends."""
    before, after = pauses(rows)
    late = (np.arange(rows) - np.array([[before], [rows - after]])) / _EDGE
    rise, fall = 0.5 * late / np.hypot(late, 1.0)
    return np.asarray((rise - fall) * (np.arange(rows) % (rows - 1) > 0))


def _completed(model: MotorModel, values: Array, load: float, time: Array) -> Array:
    """Physical values (n_parameter, ...) of all terms of a model, from those without its load."""
    before, after = pauses(time.size)
    own = np.array([load, time[before], time[-after]])[: len(model.parameters) - values.shape[0]]
    return np.concatenate([values, np.multiply.outer(own, np.ones(values.shape[1:]))])
