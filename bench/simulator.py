"""Simulation of the hidden plant over one run, without sensor noise.

The time grid is the union of the knots of the drive and of the instants t - delay of delayed
sensors.  A delay of a fraction of a sample is therefore exact and not interpolated.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.integrator import build_integrate
from bench.plant import STATES, Plant, new_drive

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["Simulation", "SimulationFailed", "Stimulus", "initial_state", "simulate"]

_INDEX = {name: number for number, name in enumerate(STATES)}
_SOURCES = (
    "plant.py", "coefficients.py", "torques.py", "physics.py", "drive.py", "integrator.py"
)  # fmt: skip
_DRY = ("coulomb_forward", "coulomb_backward", "stribeck", "load_friction", "run_in_dry",
        "hot_friction", "angle_rub")  # fmt: skip


class SimulationFailed(RuntimeError):
    """The plant diverged, or the integrator needed too many steps."""


@dataclass(frozen=True)
class Stimulus:
    """Inputs of the plant in one run.

    Args:
        time: (n_knot,) knots [s].
        command: (n_knot,) voltage command to the drive [V].
        temperature: (n_knot,) true temperature at the thermometer [degC].
        is_linear: Whether the voltage is linear between knots (FOH) or held (ZOH).
        current_limit: Current limit of the drive, 0 for none [A].
    """

    time: NDArray[np.float64]
    command: NDArray[np.float64]
    temperature: NDArray[np.float64]
    is_linear: bool = False
    current_limit: float = 0.0


@dataclass(frozen=True)
class Simulation:
    """One run of the plant without noise.

    Args:
        time: (n_knot,) knots [s].
        voltage: (n_knot,) applied voltage [V].
        states: (n_knot, n_state) with the columns of `bench.plant.STATES`.
        seen: (n_knot,) delayed state that each sensor shows, by name of the sensor.
        peak: (n_knot,) highest magnet temperature so far [degC].
    """

    time: NDArray[np.float64]
    voltage: NDArray[np.float64]
    states: NDArray[np.float64]
    seen: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    peak: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def state(self, name: str) -> NDArray[np.float64]:
        """(n_knot,) one component of the state."""
        return self.states[:, _INDEX[name]]


@functools.cache
def _compiled() -> Any:
    """Compile the integrator for the present source files."""
    here = Path(__file__).parent
    text = b"".join((here / name).read_bytes() for name in _SOURCES)
    return build_integrate(hashlib.sha256(text).hexdigest())


def initial_state(
    temperature: float, speed: float = 0.0, current: float = 0.0, angle: float = 0.0
) -> NDArray[np.float64]:
    """State of a plant with uniform temperature and settled sensor filters.

    Args:
        temperature: Temperature of all parts [degC].
        speed: Speed of motor and load [rad/s].
        current: Current [A].
        angle: Shaft angle [rad].
    """
    state = np.zeros(len(STATES))
    given = {
        "current": current,
        "speed": speed,
        "angle": angle,
        "load_speed": speed,
        "current_filter_1": current,
        "speed_filter_1": speed,
    }
    for name, value in given.items():
        state[_INDEX[name]] = value
    for name in ("winding_lag_1", "winding_lag_2", "magnet_lag_1", "magnet_lag_2"):
        state[_INDEX[name]] = temperature
    return state


def _active_states(plant: Plant) -> NDArray[np.int64]:
    """Indices of the states that this plant needs."""
    groups = (
        (True, ("current", "speed", "angle")),
        (plant["winding_lag"] > 0, ("winding_lag_1", "winding_lag_2")),
        (plant["heat_time"] > 0, ("heat_1",)),
        (plant["heat_time_2"] > 0, ("heat_2",)),
        (plant["magnet_lag"] > 0, ("magnet_lag_1", "magnet_lag_2")),
        (plant["load_inertia"] > 0, ("load_speed", "twist")),
        (plant["bristle_level"] > 0, ("bristle",)),
        (plant["current_filter"] > 0, ("current_filter_1", "current_filter_2")),
        (plant["speed_filter"] > 0, ("speed_filter_1", "speed_filter_2")),
    )
    names = [name for is_needed, group in groups if is_needed for name in group]
    return np.array([_INDEX[name] for name in names])


def _scales(plant: Plant) -> NDArray[np.float64]:
    """(n_state,) magnitude of each state, for the absolute tolerance of the integrator."""
    current, speed = 0.1 * plant["rated_current"], 0.1 * plant["rated_speed"]
    scales = np.ones(len(STATES))
    for name in ("current", "current_filter_1"):
        scales[_INDEX[name]] = current
    for name in ("speed", "load_speed", "speed_filter_1"):
        scales[_INDEX[name]] = speed
    if plant["current_filter"] > 0:
        scales[_INDEX["current_filter_2"]] = current / plant["current_filter"]
    if plant["speed_filter"] > 0:
        scales[_INDEX["speed_filter_2"]] = speed / plant["speed_filter"]
    if plant["load_inertia"] > 0:
        scales[_INDEX["twist"]] = plant["rated_torque"] / plant["shaft_stiffness"]
    if plant["bristle_level"] > 0:
        scales[_INDEX["bristle"]] = plant["bristle_deflection"]
    return scales


def simulate(
    plant: Plant,
    stimulus: Stimulus,
    start: NDArray[np.float64],
    *,
    looks_back: Mapping[str, tuple[str, float]] | None = None,
    peak: float = -273.0,
    tolerance: float = 1e-8,
) -> Simulation:
    """Simulate one run of the plant.

    Args:
        plant: Record of the hidden plant.
        stimulus: Voltage command, temperature, and settings of the drive.
        start: (n_state,) initial state.
        looks_back: Name of the state that each sensor shows and its delay [s], by name of the
            sensor.  Before the first instant, a delayed sensor shows the initial state.
        peak: Highest magnet temperature before this run [degC].
        tolerance: Relative tolerance per step.

    Raises:
        SimulationFailed: The plant diverged, or the integrator needed too many steps.
    """
    late = dict(looks_back or {})
    knots = stimulus.time
    wanted = np.concatenate([knots, *(knots - delay for _, delay in late.values())])
    grid = np.unique(wanted[wanted >= knots[0]])
    knot = np.full(grid.size, -1)
    knot[np.searchsorted(grid, knots)] = np.arange(knots.size)
    drive = new_drive()
    drive["peak"] = peak
    states, applied, peaks = _compiled()(
        plant, drive, _active_states(plant), grid, knot, stimulus.command, stimulus.temperature,
        stimulus.is_linear, float(stimulus.current_limit), start, _scales(plant), tolerance,
        any(plant[name] > 0 for name in _DRY),
    )  # fmt: skip
    if not np.all(np.isfinite(states)):
        raise SimulationFailed(
            "the plant diverged or is too stiff for the step; expected one that is stable under "
            "this load, with no time constant below a ten-thousandth of the sample interval"
        )
    seen = {
        sensor: states[np.searchsorted(grid, np.maximum(knots - delay, knots[0])), _INDEX[name]]
        for sensor, (name, delay) in late.items()
    }
    return Simulation(knots, applied, states[knot >= 0], seen, peaks)
