"""Predicted readings of a candidate run: simulation, limits and sensitivities.

The run starts at rest.  Parameters and initial state are unknown within their covariance, so the
readings of a model are normal with the covariance 1 + G C G' in units of the noise, where G holds
the sensitivities (linearisation at the estimate).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.design.models import DesignModel
from identification.fit.normal_equations import state_precision
from identification.ingest.run import Run
from identification.model.excitation import Record, records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.substeps import evenly
from identification.model.tangent import tangent

__all__ = ["Predictor", "Response"]

_MOST_SUBSTEPS: Final = 8


@dataclass(frozen=True)
class Response:
    """Readings of a model over a candidate run, in units of the noise."""

    mean: Array
    """(n,) readings of both channels."""
    sensitivity: Array
    """(n, n_parameter + n_state) derivatives by coordinates and initial states."""
    covariance: Array
    """(n_parameter + n_state, n_parameter + n_state) before the run."""
    count: int
    """Number of parameters."""

    @cached_property
    def information(self) -> Array:
        """(n_parameter, n_parameter) Fisher information with the initial states eliminated."""
        n, full = self.count, self.sensitivity.T @ self.sensitivity
        states = full[n:, n:] + np.linalg.inv(self.covariance[n:, n:])
        return np.asarray(full[:n, :n] - full[:n, n:] @ np.linalg.solve(states, full[n:, :n]))


@dataclass(frozen=True)
class Predictor:
    """Simulation of candidate runs with one model."""

    model: DesignModel
    """The model."""
    interval: float
    """Sample interval [s]."""
    noise: Array
    """(2,) standard deviations of current and speed [A, rad/s]."""
    earlier: int
    """Number of runs recorded before."""
    hottest: float
    """Highest temperature of these runs [degC]."""
    simulator: Simulator
    """Simulator over a reference run, whose step plan and substeps are used."""

    @staticmethod
    def prepared(
        model: DesignModel,
        reference: Array,
        interval: float,
        noise: Array,
        earlier: int = 0,
        hottest: float = -np.inf,
    ) -> Predictor:
        """Predictor with a step plan that suits a reference voltage of the largest amplitude.

        Args:
            model: The model.
            reference: (n_sample,) voltage [V].
            interval: Sample interval [s].
            noise: (2,) standard deviations of current and speed [A, rad/s].
            earlier: Number of runs recorded before.
            hottest: Highest temperature of these runs [degC].
        """
        zeros = np.zeros((reference.size, 2))
        record = _record(reference, 25.0, interval, zeros, earlier, hottest)
        simulator = Simulator.fitting(model.model, [record], model.draws(8, 0))
        states = [initial_states(model.model, record)]
        counts = 1
        if model.model.terms:
            fine = simulator.accurate(model.estimate, states, noise)
            counts = 1 if fine.substeps is None else int(fine.substeps[0].max())
        substeps = evenly([reference.size], min(counts, _MOST_SUBSTEPS))
        simulator = replace(simulator, substeps=None if counts == 1 else substeps)
        return Predictor(model, interval, noise, earlier, hottest, simulator)

    def states(self, voltage: Array, temperature: float, values: Array) -> Array:
        """Current and speed of the motor itself, (n_sample, 2, n_lane) [A, rad/s].

        The voltage is (n_sample,) [V], the temperature in degC, the values are physical,
        (n_parameter, n_lane).
        """
        simulator = self._over(voltage, temperature)
        start = initial_states(self.model.model, simulator.records[0])
        return simulator.states(values, [start])[0][:, :2, :]

    def response(self, voltage: Array, temperature: float) -> Response:
        """Readings and sensitivities at the estimate, for (n_sample,) [V] and [degC]."""
        one = self.model
        simulator = self._over(voltage, temperature)
        start = initial_states(one.model, simulator.records[0])
        logged, slopes = tangent(simulator, one.estimate, [start], np.diag(one.slopes))
        # The prior of the initial states is as wide as the signals, as in a fit of the run.
        record = simulator.records[0]
        signals = replace(simulator, records=(replace(record, measured=logged[0]),))
        size = one.estimate.size
        covariance = np.zeros((size + simulator.n_state,) * 2)
        covariance[:size, :size] = one.covariance
        covariance[size:, size:] = np.diag(1.0 / state_precision(signals, 0))
        weight = np.sqrt(one.fraction * record.weight) / self.noise
        mean = (logged[0] * weight).ravel()
        sensitivity = (slopes[0] * weight[:, :, None]).reshape(mean.size, -1)
        return Response(mean, sensitivity, covariance, size)

    def _over(self, voltage: Array, temperature: float) -> Simulator:
        """Simulator over a candidate run; the angle is that of the simulated shaft."""
        readings = np.zeros((voltage.size, 2))
        simulator = self._with(voltage, temperature, readings)
        if any("position" in term.drivers for term in self.model.model.terms):
            start = initial_states(self.model.model, simulator.records[0])
            values = self.model.estimate[:, None]
            readings = simulator.states(values, [start])[0][:, :2, 0]
            simulator = self._with(voltage, temperature, readings)
        return simulator

    def _with(self, voltage: Array, temperature: float, readings: Array) -> Simulator:
        known = (voltage, temperature, self.interval, readings, self.earlier, self.hottest)
        record = _record(*known).within(self.model.model.edges)
        return replace(self.simulator, records=(record,))


def _record(
    voltage: Array,
    temperature: float,
    interval: float,
    readings: Array,
    earlier: int,
    hottest: float,
) -> Record:
    run = Run(
        name="design",
        sha256="",
        time=interval * np.arange(voltage.size, dtype=np.float64),
        voltage=voltage,
        current=readings[:, 0],
        speed=readings[:, 1],
        temperature=np.full(voltage.size, temperature),
    )
    return records_of([run], earlier, hottest)[0]
