"""Table of motors from instrument to traction size, and a generator of random motors.

Each motor has the rated values of its data sheet and the seven parameters of the nominal model.
The sizes of effects are relative to rated torque or voltage, and the time scales of campaigns to
the time constants.

    >>> motor("servo_150w").rated_torque > 0.4
    True
    >>> 1e-8 < random_motor(seed=7).J < 1.0
    True
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

__all__ = ["MOTORS", "Motor", "motor", "random_motor"]

_MAGNETS = {"ferrite": -0.0020, "NdFeB": -0.0011, "SmCo": -0.0004, "AlNiCo": -0.0002}


@dataclass(frozen=True)
class Motor:
    """Brushed DC motor with its rated values and the sample interval of its bench.

    Args:
        name: Name in the table.
        rated_voltage: Rated voltage [V].
        rated_current: Rated current [A].
        rated_speed: Speed at rated voltage and current [rad/s].
        Ra25: Armature resistance at 25 degC [ohm].
        alpha_Ra: Its temperature coefficient [1/K].
        Kt25: Torque and back-EMF constant at 25 degC [N m/A].
        alpha_Kt: Its temperature coefficient [1/K].
        J: Inertia [kg m^2].
        b: Viscous friction [N m s/rad].
        L: Armature inductance [H].
        sample_interval: Sample interval [s].
    """

    name: str
    rated_voltage: float
    rated_current: float
    rated_speed: float
    Ra25: float
    alpha_Ra: float
    Kt25: float
    alpha_Kt: float
    J: float
    b: float
    L: float
    sample_interval: float

    @property
    def rated_torque(self) -> float:
        """Electromagnetic torque at rated current and 25 degC [N m]."""
        return self.Kt25 * self.rated_current

    @property
    def parameters(self) -> dict[str, float]:
        """The seven parameters of the nominal model, by their names in result files."""
        names = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L")
        return {name: getattr(self, name) for name in names}

    @property
    def time_constants(self) -> tuple[float, float]:
        """Fast and slow time constant of the linear motor at 25 degC [s].

        They are the negative reciprocals of the real parts of the two eigenvalues.  An underdamped
        motor (long electrical time constant) therefore also gets excitations of a suitable speed.
        """
        matrix = np.array(
            [[-self.Ra25 / self.L, -self.Kt25 / self.L], [self.Kt25 / self.J, -self.b / self.J]]
        )
        fast, slow = np.sort(-1.0 / np.linalg.eigvals(matrix).real)
        return float(fast), float(slow)


MOTORS: dict[str, Motor] = {
    entry.name: entry
    for entry in (
        # name, V, A, rad/s, Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L, sample interval
        Motor("instrument_1w", 6.0, 0.2, 655.0, 12.0, 0.0039, 0.0055, -0.0011,
              5.0e-8, 6.0e-8, 0.9e-3, 1.0e-3),
        Motor("coreless_10w", 12.0, 0.9, 828.0, 2.3, 0.0039, 0.012, -0.0004,
              1.0e-6, 4.0e-7, 2.5e-4, 1.0e-3),
        Motor("ferrite_fan_30w", 24.0, 1.8, 301.0, 2.8, 0.0040, 0.063, -0.0020,
              2.0e-5, 2.0e-5, 3.5e-3, 5.0e-4),
        Motor("wiper_60w", 12.0, 6.0, 300.0, 0.35, 0.0038, 0.033, -0.0019,
              8.0e-5, 5.0e-5, 6.0e-4, 2.0e-3),
        Motor("servo_150w", 48.0, 4.2, 377.0, 1.1, 0.0039, 0.115, -0.0012,
              1.2e-4, 6.0e-5, 2.6e-3, 1.0e-3),
        Motor("paper_motor", 24.0, 37.0, 26.0, 0.59, 0.0040, 0.071, -0.0020,
              1.0e-2, 0.1, 0.5, 1.0e-2),
        Motor("disc_servo_750w", 90.0, 10.0, 311.0, 0.6, 0.0039, 0.27, -0.0002,
              1.5e-3, 4.0e-4, 1.0e-4, 1.0e-3),
        Motor("winch_1500w", 96.0, 20.0, 196.0, 0.28, 0.0040, 0.46, -0.0021,
              8.0e-2, 3.0e-3, 2.2e-3, 5.0e-3),
        Motor("machine_tool_3kw", 180.0, 20.0, 180.0, 0.45, 0.0039, 0.95, -0.0018,
              2.0e-2, 5.0e-3, 9.0e-3, 1.0e-3),
        Motor("traction_10kw", 300.0, 38.0, 158.0, 0.4, 0.0039, 1.8, -0.0010,
              0.5, 3.0e-2, 1.2e-2, 2.0e-3),
    )
}  # fmt: skip


def motor(name: str) -> Motor:
    """Return a motor of the table.

    Raises:
        KeyError: The table has no motor of that name; the message lists the names.
    """
    if name not in MOTORS:
        raise KeyError(f"no motor '{name}' in the table; it has {', '.join(MOTORS)}")
    return MOTORS[name]


def _round_125(value: float) -> float:
    """Nearest of 1, 2, 5 times a power of ten, the usual sample intervals of a bench."""
    decade = 10.0 ** math.floor(math.log10(value))
    steps = np.array([1.0, 2.0, 5.0, 10.0])
    best = steps[np.argmin(np.abs(np.log(steps * decade / value)))]
    return float(f"{best * decade:.6g}")


def random_motor(seed: int) -> Motor:
    """Random motor between 1 W and 10 kW with consistent parameters.

    Power is log-uniform.  Voltage, current, speed, losses and inertia follow from it, with the
    scatter of real motors in catalogues.  The ratio of electrical time constant to sample interval
    is log-uniform over 0.1 to 30, because this ratio determines how difficult simulation and
    identification are.

    Args:
        seed: Equal seeds give equal motors.
    """
    draw = np.random.default_rng([seed, 20141])
    power = 10.0 ** draw.uniform(0.0, 4.0)
    speed = float(np.clip(700.0 * power**-0.17 * draw.lognormal(0.0, 0.3), 60.0, 1000.0))
    voltage = float(np.clip(6.0 * power**0.42 * draw.lognormal(0.0, 0.25), 3.0, 480.0))
    loss = float(np.clip(0.35 * power**-0.2 * draw.lognormal(0.0, 0.25), 0.04, 0.45))
    current = power / (voltage * (1.0 - loss))
    kt25 = voltage * (1.0 - loss) / speed
    ra25 = voltage * loss / current
    b = kt25 * current / speed * draw.uniform(0.02, 0.12)
    slow = 0.012 * power**0.12 * draw.lognormal(0.0, 0.5)
    inertia = slow * (kt25**2 / ra25 + b)
    interval = _round_125(slow / draw.uniform(10.0, 40.0))
    electrical = float(np.clip(interval * 10.0 ** draw.uniform(-1.0, 1.5), 0.0, 2.0 * slow))
    magnet = _MAGNETS[str(draw.choice(list(_MAGNETS)))] * draw.uniform(0.85, 1.15)
    figures = (
        voltage, current, speed, ra25, draw.uniform(0.0037, 0.0041), kt25, magnet,
        inertia, b, electrical * ra25, interval,
    )  # fmt: skip
    return Motor(f"random_{seed}", *(float(f"{figure:.4g}") for figure in figures))
