"""Gear whose friction is in proportion to the torque that it transmits."""

from __future__ import annotations

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.gear import GearFriction
from tests.effects.hidden import all_but
from tests.motors import motor_named

SERVO = motor_named("servo 100 W")
ROWS = 1500
TEMPERATURES = (25.0, 50.0, 75.0, 40.0)
STEPS = 10
"""Steps of the simulation per sample interval."""
BEHIND = 0.75
"""Share of the inertia behind the gear."""


WITHHELD = all_but(
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_drag",
    "viscous_temperature",
    "flux_saturation",
)


def geared(
    voltage: np.ndarray, degrees: float, friction: float, *, of_motor: bool = False
) -> np.ndarray:
    """(n, 2) current [A] and speed [rad/s] of the servo, by Heun's method.

    The torque s = J_2 dw/dt of the gear causes the friction `friction` |s| against the motion, so
    that the sum of the other torques accelerates J_1 + J_2 (1 +- friction).  With `of_motor`, the
    torque of the motor causes the friction.
    """
    ra, slope, kt, fall, inertia, viscous, inductance = SERVO.values
    resistance = ra * (1.0 + slope * (degrees - 25.0))
    constant = kt * (1.0 + fall * (degrees - 25.0))
    step = SERVO.interval / STEPS

    def rates(current: float, speed: float, volt: float) -> tuple[float, float]:
        torque = constant * current - viscous * speed
        if of_motor:
            torque -= friction * abs(constant * current) * np.sign(speed)
        sign = 0.0 if of_motor else np.sign(speed) * np.sign(torque)
        total = inertia * (1.0 - BEHIND + BEHIND * (1.0 + friction * sign))
        return (volt - resistance * current - constant * speed) / inductance, torque / total

    current = speed = 0.0
    found = np.empty((voltage.size, 2))
    for row, volt in enumerate(voltage):
        found[row] = current, speed
        for _ in range(STEPS):
            first = rates(current, speed, volt)
            second = rates(current + step * first[0], speed + step * first[1], volt)
            current += step * (first[0] + second[0]) / 2
            speed += step * (first[1] + second[1]) / 2
    return found


def outcome_of(friction: float, *, of_motor: bool = False) -> Outcome:
    """Outcome of the search on four runs with steps of the voltage in both directions."""
    rng = np.random.default_rng(5)
    time = SERVO.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for number, degrees in enumerate(TEMPERATURES):
        level = rng.uniform(-SERVO.voltage, SERVO.voltage, ROWS // 50)
        voltage = np.repeat(level, 50)
        true = geared(voltage, degrees, friction, of_motor=of_motor)
        noisy = true + 3e-3 * np.abs(true).max(axis=0) * rng.standard_normal(true.shape)
        warm = np.full(ROWS, degrees)
        current, speed = noisy.T
        runs.append(Run(f"run{number}.csv", "0" * 64, time, voltage, current, speed, warm))
    campaign = campaign_of(runs[:3], runs[3:])
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)


@pytest.mark.parametrize(("of_motor", "behind"), [(False, BEHIND), (True, 1.0)])
def test_a_gear_is_named_with_its_friction(of_motor: bool, behind: float) -> None:
    """Known: the coefficient times the share behind the gear, and the parameters of the servo."""
    outcome = outcome_of(0.2, of_motor=of_motor)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, GearFriction)
    assert term.of_motor is of_motor
    deviation = np.sqrt(np.diag(outcome.fit.equations.covariance()))
    position = outcome.fit.coordinates.of(np.append(SERVO.vector, 0.2 * behind))
    assert np.all(np.abs(outcome.fit.position - position) < 4.0 * deviation)


def test_a_gear_without_friction_has_no_effect() -> None:
    """The same bench has no effect."""
    assert outcome_of(0.0).effects == ()


def test_a_gear_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    settings = {"torque_size": 0.3, "speed_size": 200.0}

    entry = {"name": "unlisted", "equation": "mechanical", "settings": settings}
    assert term_of(entry) == GearFriction(0.3, 200.0)
