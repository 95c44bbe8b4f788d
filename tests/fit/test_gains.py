"""Gain of the current sensor: one run does not determine it, two runs give the ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.gains import GainRatio, current_gains, with_one_gain
from identification.ingest.run import Run
from identification.options import FitOptions
from identification.pipeline import identify
from identification.result.collect import report_data
from tests.motors import NAMES, Motor, campaign, motor_named

SERVO = motor_named("servo 100 W")


def driven(motor: Motor, gain: float = 1.0, *, seed: int = 1) -> Run:
    """Run of a motor whose current is logged with a gain."""
    run = campaign(motor, seed=seed, noise=0.005, rows=1500)[0]
    return replace(run, current=run.current * gain)


def gains(training: Sequence[Run], validation: Sequence[Run]) -> tuple[GainRatio, ...]:
    """Gain ratios found in a campaign of these runs."""
    made = campaign_of(training, validation)
    return current_gains(fit_declared(made.training, "zoh"), made)


@pytest.mark.parametrize("gain", [0.5, 1.6, 10.0])
def test_the_ratio_of_two_gains_is_found(gain: float) -> None:
    """Reference: the gain with which the second run was logged."""
    (found,) = gains([driven(SERVO)], [driven(SERVO, gain, seed=2)])

    assert found.run == 1
    assert found.ratio == pytest.approx(gain, rel=0.02)


def test_runs_of_one_gain_have_no_ratio() -> None:
    """All runs have the same gain."""
    assert gains([driven(SERVO), driven(SERVO, seed=2)], [driven(SERVO, seed=3)]) == ()


@pytest.mark.parametrize("changed", ["Ra25", "J"])
def test_another_resistance_or_inertia_is_no_gain(changed: str) -> None:
    """A gain changes both balances in opposite directions; another R or J changes one of them."""
    values = [1.5 * v if n == changed else v for n, v in zip(NAMES, SERVO.values, strict=True)]
    other = replace(SERVO, values=tuple(values))  # type: ignore[arg-type]

    assert gains([driven(SERVO)], [driven(other, seed=2)]) == ()


@pytest.mark.parametrize("first", [300.0, -150.0])
def test_a_coast_down_with_open_terminals_has_no_gain(first: float) -> None:
    """Without current the voltage is the back-EMF Kt w, and J dw/dt = -b w - T sgn w.

    The run fits any motor with a large resistance and a small inertia of the same b / J.
    """
    _, _, constant, change, inertia, friction, _ = SERVO.values
    dry = 0.02 / friction
    run = driven(SERVO, seed=2)
    noise = 0.02 * np.random.default_rng(3).standard_normal((3, run.rows))
    falling = (abs(first) + dry) * np.exp(-friction / inertia * run.time) - dry
    speed = np.copysign(np.maximum(falling, 0.0), first)
    assert run.temperature is not None
    kt = constant * (1.0 + change * (run.temperature - 25.0))
    coasting = replace(
        run, voltage=kt * speed + noise[0], current=noise[1], speed=speed + 10.0 * noise[2]
    )

    assert gains([driven(SERVO), coasting], []) == ()


def test_all_runs_are_scaled_to_the_gain_of_the_first() -> None:
    """The fit to the scaled runs has the parameters of the motor in the first run."""
    made = campaign_of([driven(SERVO), driven(SERVO, 0.5, seed=2)], [])
    found = current_gains(fit_declared(made.training, "zoh"), made)

    fit = fit_declared(with_one_gain(made, found).training, "zoh")

    assert fit.values[0] == pytest.approx(SERVO.vector[0], rel=0.01)
    assert fit.values[4] == pytest.approx(SERVO.vector[4], rel=0.01)
    assert any(w.code == "unknown_current_gain" for w in with_one_gain(made, found).warnings)


def test_the_report_draws_all_currents_with_the_gain_of_the_first_run() -> None:
    """The errors of the result are those of the scaled currents, so the plots show these."""
    options = FitOptions(effects=False, posterior=False)
    found = identify([driven(SERVO)], [driven(SERVO, 0.5, seed=2)], options)

    run = report_data(found.result, found.findings).runs[1]
    error = float(np.sqrt(np.nanmean((run.measured_current - run.after_current) ** 2)))
    assert error == pytest.approx(
        found.result["errors"]["after"]["validation"]["current"]["rmse"], rel=0.01
    )
