"""Judgement of controllers: metrics of each draw and temperature, and distance from the limits.

Margins belong to the linear loop with its delay; all other metrics are those of the simulated loop
with effects, sampling and limits.  A draw meets the specification if it meets every requirement at
every temperature, so the probability is that of one motor over the whole temperature range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.errors import OptionError
from identification.speed_loop.loop import Loop
from identification.speed_loop.margins import delayed_margins
from identification.speed_loop.sampled import ends, sampled_metrics
from identification.tuning.drive import GAINS, Drive, Response, most_samples
from identification.tuning.motor import UncertainMotor
from identification.tuning.specification import METRICS, Specification

__all__ = ["Judge", "Judgement", "slack_at"]

_NUMBERS_AT_ONCE: Final = 2e7
_LEAST_SAMPLES: Final = 40
_BEYOND: Final = {"rise_time": 8.0, "settling_time": 3.0}
_TIME_CONSTANTS: Final = 8.0


@dataclass(frozen=True)
class Judgement:
    """Metrics of controllers."""

    metrics: dict[str, Array]
    """For each name of `METRICS` (n_controller, n_temperature, n_draw)."""
    slack: dict[str, Array]
    """For each required metric its distance from the limit, of the same shape [-]."""
    limited: Bool
    """True if voltage or current reach their limit, of the same shape."""
    peak_current: Array
    """Largest current, of the same shape [A]."""
    peak_voltage: Array
    """Largest voltage at the motor, of the same shape [V]."""

    @property
    def of_draws(self) -> Array:
        """Smallest distance over requirements and temperatures, (n_controller, n_draw) [-]."""
        return np.asarray(np.min(np.stack(list(self.slack.values())), axis=(0, 2)))


def slack_at(of_draws: Array, probability: float) -> Array:
    """Distance that the fraction `probability` of the draws (last axis) reaches or exceeds.

    It is at least 0 if and only if at least that fraction meets the specification.
    """
    count = of_draws.shape[-1]
    index = min(count - 1, math.floor((1 - probability) * count + 1e-9))
    return np.asarray(np.sort(of_draws, axis=-1)[..., index])


@dataclass(frozen=True)
class Judge:
    """Judge of controllers for one motor, specification and step of the reference [rad/s]."""

    motor: UncertainMotor
    specification: Specification
    temperatures: list[float]
    step: float

    def of(self, motor: UncertainMotor, temperatures: list[float] | None = None) -> Judge:
        """The same judge for other draws or temperatures."""
        return replace(self, motor=motor, temperatures=temperatures or self.temperatures)

    def samples(self) -> int:
        """Number of sample times that the required times need.

        Raises:
            OptionError: There are too many.
        """
        spec = self.specification
        needed = [factor * (getattr(spec, name) or 0.0) for name, factor in _BEYOND.items()]
        if not any(needed):
            _, denominator = self.motor.plants(self.temperatures[0])
            needed.append(_TIME_CONSTANTS * float(np.median(denominator[:, 1] / denominator[:, 2])))
        count = math.ceil(max(needed) / spec.sample_time)
        if count > most_samples(spec):
            raise OptionError(
                f"specification: the response of {max(needed):.3g} s has {count} sample times; "
                f"expected at most {most_samples(spec)}: shorten the required times or lengthen "
                "sample_time"
            )
        return max(count, _LEAST_SAMPLES)

    def judged(self, gains: Array, samples: int | None = None) -> Judgement:
        """Metrics of controllers (4, n_controller) for every draw at every temperature.

        The gains are in the order of `GAINS`.  By default as many sample times are simulated as the
        required times need.
        """
        count, samples = gains.shape[1], samples or self.samples()
        motors = replace(self.motor, values=np.tile(self.motor.values, (1, count)))
        columns = np.repeat(gains, self.motor.count, axis=1)
        found = self.margins(gains) | self._simulated(motors, columns, samples)
        found = {name: value.reshape(count, -1, self.motor.count) for name, value in found.items()}
        slack = {
            name: METRICS[name].slack(found[name], limit)
            for name, limit in self.specification.required.items()
        }
        metrics = {name: found[name] for name in METRICS}
        return Judgement(
            metrics, slack, found["limited"] > 0, found["peak_current"], found["peak_voltage"]
        )

    def margins(self, gains: Array) -> dict[str, Array]:
        """Margins, (n_controller, n_temperature, n_draw): gain [dB] and phase [deg]."""
        plants = [self.motor.plants(temperature) for temperature in self.temperatures]
        gain = np.concatenate([plant[0] for plant in plants])
        poles = np.concatenate([plant[1] for plant in plants])
        count, loops = gains.shape[1], gain.size
        loop = _loops(np.tile(gain, count), np.tile(poles, (count, 1)), gains.repeat(loops, axis=1))
        found = delayed_margins(
            loop, self.specification.lag, np.pi / self.specification.sample_time
        )
        shape = (count, len(plants), self.motor.count)
        return {
            "gain_margin": found.gain_db.reshape(shape),
            "phase_margin": found.phase_deg.reshape(shape),
        }

    def responses(self, gains: Array, samples: int, reference: float = 0.0) -> list[Response]:
        """Step responses of one controller, for each temperature, with every draw."""
        drive = Drive(self.motor, self.specification)
        return drive.responses(gains, reference or self.step, self.temperatures, samples)

    def _simulated(self, motors: UncertainMotor, gains: Array, samples: int) -> dict[str, Array]:
        """Metrics of the responses, (n_controller * n_temperature * n_draw,) each."""
        rows = 5 * samples * Drive(motors, self.specification).substeps * len(self.temperatures)
        # Whole controllers, so that the columns of a block stay together.
        block = self.motor.count * max(1, int(_NUMBERS_AT_ONCE / rows / self.motor.count))
        parts: list[dict[str, Array]] = []
        for first in range(0, motors.count, block):
            lanes = slice(first, first + block)
            some = replace(motors, values=motors.values[:, lanes])
            drive = Drive(some, self.specification)
            found = drive.responses(gains[:, lanes], self.step, self.temperatures, samples)
            each = [_metrics(one, self.step, gains[:, lanes]) for one in found]
            parts.append({name: np.stack([one[name] for one in each]) for name in each[0]})
        whole = {name: np.concatenate([p[name] for p in parts], axis=1) for name in parts[0]}
        # (n_temperature, n_controller * n_draw) to (n_controller, n_temperature, n_draw).
        shape = (len(self.temperatures), -1, self.motor.count)
        return {name: v.reshape(shape).transpose(1, 0, 2) for name, v in whole.items()}


def _metrics(response: Response, step: float, gains: Array) -> dict[str, Array]:
    speed = response.speed / step
    integrates = gains[GAINS.index("ki")] != 0
    with np.errstate(all="ignore"):
        end, _ = ends(speed)
        # With integral action the final speed is the reference, also before it is reached.
        final = np.where(integrates, 1.0, end)
        steady_error = np.round(100 * np.abs(1 - end), 9)  # without the rounding of the simulation
        found = sampled_metrics(response.time, speed, response.acceleration / step, final)
        return {
            "rise_time": found.rise_time,
            "settling_time": found.settling_time,
            "overshoot": found.overshoot,
            "steady_error": steady_error,
            "limited": response.limited.max(axis=0),
            "peak_current": np.abs(response.current).max(axis=0),
            "peak_voltage": np.abs(response.voltage).max(axis=0),
        }


def _loops(gain: Array, poles: Array, gains: Array) -> Loop:
    """Open loops, without a cancelled integrator if no controller has one."""
    kp, ki, kd, _ = gains
    if not ki.any():
        return Loop(gain[:, None] * np.stack([kd, kp], axis=1), poles)
    numerator = gain[:, None] * np.stack([kd, kp, ki], axis=1)
    return Loop(numerator, np.pad(poles, ((0, 0), (0, 1))))
