"""Feedback metrics of the motor with its effects, by simulation of the closed loop.

Friction, brush drop or saturation make the response depend on the size of the step, which the
linear metrics cannot represent.  Each entry states its step: the largest one whose linear response
stays within the speeds, voltages and currents of the training runs, so that no effect is
extrapolated.

The sample interval is halved until rise time, settling time and final value converge, and the
simulated time is doubled until the speed settles.  With a torque that depends on the angle, the
shaft makes a revolution in the last tenth of it, over which the final value is a mean.  For a
linear motor the first simulation is exact, and its metrics are those of `step_response`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array, Bool, evenly
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.model.term import AbstractTerm
from identification.speed_loop.closed_loop import ClosedLoop, LoopRun, acting_terms, simulated_loop
from identification.speed_loop.controller import AbstractController, parse_controllers
from identification.speed_loop.loop import Loop, close, motor_draws
from identification.speed_loop.metrics import StepMetrics, quantities
from identification.speed_loop.sampled import is_at_rest, sampled_metrics
from identification.speed_loop.spread import checked_temperatures
from identification.speed_loop.step_response import StepResponse, step_metrics

__all__ = ["SimulatedLoop", "nonlinear_entry", "simulated_loops", "with_some_inductance"]

_DRAWS: Final = 64
_SAMPLES: Final = 1000
_MOST_SAMPLES: Final = 16_000
_BEYOND_SETTLING: Final = 6.0
_LONGER: Final = 3
_MOST_LONGER: Final = 64.0
"""Largest factor of the simulated time for whole revolutions: the rise keeps several samples."""
_AGREE: Final = 1e-3
_WITHIN: Final = 0.99
_LEAST_ELECTRICAL_SHARE: Final = 1e-6


@dataclass(frozen=True)
class SimulatedLoop:
    """Simulated step responses of one controller at one temperature."""

    controller: str
    temperature_degC: float  # noqa: N815
    """Temperature of winding and magnet [degC]."""
    step: float
    """Size of the step of the reference [rad/s]."""
    effects: tuple[str, ...]
    time: Array
    """(n_time,) from 0 [s]."""
    speed: Array
    """(n_time, n_draw) divided by the step [-]."""
    metrics: StepMetrics
    settled: Bool
    """(n_draw,) whether the speed settled at its final value."""


def simulated_loops(
    fit: Fit,
    draws: Mapping[str, ArrayLike],
    temperatures: Sequence[float],
    controllers: Sequence[str | AbstractController],
) -> list[SimulatedLoop]:
    """Step responses of the closed loop with the effects of the final model.

    The records of the fit define the range of the signals.  The responses are in the order of
    `feedback_metrics`, without controllers whose linear loops do not settle; empty if no effect
    acts on the motor in a closed loop.
    """
    model = fit.simulator.model
    terms = acting_terms(model)
    if not terms:
        return []
    kept = evenly(np.asarray(draws["J"]).size, _DRAWS)
    some = {name: np.asarray(values, dtype=np.float64)[kept] for name, values in draws.items()}
    bench = _Bench(fit, terms, some, checked_temperatures(temperatures))
    return [
        loop
        for controller in parse_controllers(controllers)
        for loop in bench.responses(controller)
    ]


def nonlinear_entry(loop: SimulatedLoop) -> dict[str, Any]:
    """Entry like those of `feedback_metrics`, with the step and the effects.

    Peak and final value are divided by the step, so they are comparable with those of the linear
    loop.  Margins and bandwidth are defined for linear loops only and are null.
    """
    count, share = loop.settled.size, float(loop.settled.mean())
    words = f"all {count}" if share == 1 else f"{100 * share:.3g} % of {count}"
    return {
        "temperature_degC": loop.temperature_degC,
        "controller": loop.controller,
        "step_rad_s": loop.step,
        "effects": list(loop.effects),
        "stable_probability": share,
        "statement": f"the speed settles in {words} draws",
    } | quantities(loop.metrics, [np.full(count, np.nan)] * 3, slice(None))


class _Bench:
    """Data that all loops of one motor share."""

    def __init__(
        self,
        fit: Fit,
        terms: tuple[AbstractTerm, ...],
        draws: dict[str, Array],
        temperatures: list[float],
    ) -> None:
        self.fit, self.temperatures = fit, temperatures
        self.model = MotorModel(terms)
        self.draws = with_some_inductance(draws)
        self.values = np.array([self.draws[p.name] for p in self.model.parameters])
        records = fit.simulator.records
        self.peak = max(float(r.column("peak_temperature").max()) for r in records)
        measured = np.abs(np.concatenate([r.measured for r in records]))
        voltage = np.abs(np.concatenate([r.column("voltage") for r in records]))
        self.range = np.array([*np.quantile(measured, _WITHIN, axis=0), np.quantile(voltage, 0.99)])
        known = dict(zip(fit.simulator.model.state_names, fit.states[0], strict=True))
        states = [(term, f"{term.name}.{state.name}") for term in terms for state in term.states]
        turning = [known[name] if "position" in term.drivers else 0.0 for term, name in states]
        self.own = np.array(turning)

    def responses(self, controller: AbstractController) -> list[SimulatedLoop]:
        """Simulated loops of one controller, by temperature.

        The list is empty if fewer than half of the linear loops settle, or if no step stays within
        the range of the runs, as for a motor that stood still.
        """
        horizon = self._horizon(controller)
        step = None if horizon is None else self._step(controller, horizon)
        if horizon is None or step is None:
            return []
        loop = ClosedLoop(self.model.terms, controller=controller)
        samples = _SAMPLES
        if loop.turns:
            longer = min(self._ten_revolutions(controller, step) / horizon, _MOST_LONGER)
            samples = int(np.clip(longer * samples, samples, _MOST_SAMPLES / 2))
            horizon *= max(longer, 1.0)
        runs, events = self._converged(loop, step, horizon, samples)
        return [
            SimulatedLoop(
                controller.text, temperature, step, tuple(t.name for t in self.model.terms),
                run.time, run.speed / step, event, _settled(run, step)
            )
            for temperature, run, event in zip(self.temperatures, runs, events, strict=True)
        ]  # fmt: skip

    def _horizon(self, controller: AbstractController) -> float | None:
        """Simulated time: six times the 95 % quantile of the linear settling times [s].

        None if fewer than half of the linear loops settle.
        """
        linear = step_metrics(StepResponse(self._linear(controller)))
        settling = linear.settling_time[np.isfinite(linear.settling_time)]
        if settling.size < 0.5 * linear.settling_time.size:
            return None
        return _BEYOND_SETTLING * float(np.quantile(settling, 0.95))

    def _linear(self, controller: AbstractController) -> Loop:
        motors = motor_draws(self.draws, self.temperatures)
        return close(motors, self.temperatures, controller)

    def _ten_revolutions(self, controller: AbstractController, step: float) -> float:
        """Time of ten revolutions at the lowest final speed of the stable linear loops [s]."""
        linear = StepResponse(self._linear(controller))
        return float(20.0 * np.pi / (step * np.abs(linear.final[linear.is_stable]).min()))

    def _step(self, controller: AbstractController, horizon: float) -> float | None:
        """Largest step, to two digits, whose linear response stays in the range of the runs.

        None if that range is zero.
        """
        middle = np.median(self.values[:7], axis=1, keepdims=True)
        runs = self._runs(ClosedLoop((), controller=controller), middle, 1.0, horizon, _SAMPLES)
        signals = zip(*((run.current, run.speed, run.voltage) for run in runs), strict=True)
        peaks = [float(np.abs(signal).max()) for signal in signals]
        largest = float(np.min(self.range / np.maximum(peaks, 1e-300)))
        if not 0.0 < largest < np.inf:
            return None
        ten = 10.0 ** (np.floor(np.log10(largest)) - 1)
        return float(f"{np.floor(largest / ten) * ten:.2g}")

    def _runs(
        self, loop: ClosedLoop, values: Array, step: float, horizon: float, samples: int
    ) -> list[LoopRun]:
        conditions = [(temperature, self.peak) for temperature in self.temperatures]
        own = self.own if loop.terms else np.zeros(0)
        time = np.linspace(0.0, horizon, samples + 1)
        return simulated_loop(loop, values, own, step, conditions, time)

    def _converged(
        self, loop: ClosedLoop, step: float, horizon: float, samples: int
    ) -> tuple[list[LoopRun], list[StepMetrics]]:
        """Simulate for longer and with shorter intervals until the metrics converge."""
        runs = self._runs(loop, self.values, step, horizon, samples)
        for _ in range(_LONGER):
            if all(np.mean(_settled(run, step)) > 0.5 for run in runs):
                break
            horizon, samples = 2 * horizon, 2 * samples
            runs = self._runs(loop, self.values, step, horizon, samples)
        events, agree = [_events(run, step) for run in runs], False
        while samples < _MOST_SAMPLES and not agree:
            samples *= 2
            runs = self._runs(loop, self.values, step, horizon, samples)
            finer = [_events(run, step) for run in runs]
            agree = all(_agree(a, b) for a, b in zip(events, finer, strict=True))
            events = finer
        return runs, events


def with_some_inductance(draws: dict[str, Array]) -> dict[str, Array]:
    """Draws whose electrical time constant is at least 1e-6 of the mechanical one.

    A shorter one could not be simulated; this one changes no reported digit.
    """
    static = draws["Ra25"] * draws["b"] + draws["Kt25"] ** 2
    least = _LEAST_ELECTRICAL_SHARE * draws["Ra25"] ** 2 * draws["J"] / static
    return draws | {"L": np.maximum(draws["L"], least)}


def _settled(run: LoopRun, step: float) -> Bool:
    return np.asarray(np.isfinite(run.speed).all(axis=0) & is_at_rest(run.speed / step))


def _events(run: LoopRun, step: float) -> StepMetrics:
    return sampled_metrics(run.time, run.speed / step, run.acceleration / step)


def _agree(coarse: StepMetrics, fine: StepMetrics) -> bool:
    """True if halving the interval changes the metrics by at most 0.1 % in 90 % of the draws."""
    for name in ("rise_time", "settling_time", "steady_state"):
        a, b = getattr(coarse, name), getattr(fine, name)
        both = np.isfinite(a) & np.isfinite(b)
        if both.any() and np.quantile(np.abs(a[both] / b[both] - 1), 0.9) > _AGREE:
            return False
    return True
