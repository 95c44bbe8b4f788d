"""Noise of the logged voltage and its bias of the fitted resistance and inductance."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.evaluate import voltage_noise_power
from identification.fit.voltage import with_smooth_voltage
from identification.ingest.run import Run
from identification.options import FitOptions
from identification.pipeline import identify
from identification.prediction import predict
from identification.selection.evidence import evaluated, scores_of
from identification.selection.trials import Trials
from tests.motors import Motor, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS = 1500


def wavy(seed: int, jitter: float = 0.0) -> Run:
    """Run with a sum of slow sines, and noise of current and speed.

    Args:
        seed: Seed of the noise.
        jitter: Standard deviation of a jitter that is a voltage at the motor [V].
    """
    rng = np.random.default_rng(seed)
    time = MOTOR.interval * np.arange(ROWS)
    waves = (np.sin(2 * np.pi * f * time + seed * f) for f in (0.7, 1.9, 3.1))
    voltage = 5.0 * np.sum([*waves], axis=0) + jitter * rng.standard_normal(ROWS)
    hold: Literal["zoh", "foh"] = "zoh" if jitter else "foh"
    run = run_of(MOTOR, voltage, np.full(ROWS, 25.0 + 20.0 * seed), np.zeros(2), hold)
    current = run.current + 0.01 * np.std(run.current) * rng.standard_normal(ROWS)
    speed = run.speed + 0.01 * np.std(run.speed) * rng.standard_normal(ROWS)
    return replace(run, current=current, speed=speed, name=f"run{seed}.csv")


def with_noise(run: Run, size: float) -> Run:
    """The run with noise of the voltage sensor [V]."""
    rng = np.random.default_rng(int(run.name[3]) + 50)
    return replace(run, voltage=run.voltage + size * rng.standard_normal(run.rows))


def knob(seed: int, step: float, *, follows: bool = False) -> Run:
    """Run of a voltage that is turned up and down by hand and held in between, logged in steps [V].

    With `follows`, a supply with such steps applies the logged voltage.
    """
    rng = np.random.default_rng(seed)
    turns = np.sort(np.concatenate([np.linspace(0, ROWS, 7), np.linspace(100, ROWS + 100, 7)]))
    voltage = np.interp(np.arange(ROWS), turns, np.repeat(rng.uniform(-20.0, 20.0, 7), 2))
    logged = step * np.round(voltage / step)
    temperature = np.full(ROWS, 25.0 + 20.0 * seed)
    run = run_of(MOTOR, logged if follows else voltage, temperature, np.zeros(2), "zoh")
    current = run.current + 0.01 * np.std(run.current) * rng.standard_normal(ROWS)
    speed = run.speed + 0.001 * np.std(run.speed) * rng.standard_normal(ROWS)
    return replace(run, voltage=logged, current=current, speed=speed, name=f"run{seed}.csv")


def decided(runs: list[Run]) -> tuple[Campaign, Campaign]:
    """The campaign before and after the decision."""
    campaign = campaign_of(runs[:2], runs[2:])
    declared = fit_declared(campaign.training, "zoh")
    return campaign, with_smooth_voltage(campaign, declared, "auto")[0]


def errors(motor: Motor, campaign: Campaign) -> dict[str, float]:
    """Relative errors of Ra25 and L of the nominal model with a first-order hold [-]."""
    values = fit_declared(campaign.training, "foh").values
    return {"Ra25": values[0] / motor.values[0] - 1.0, "L": values[6] / motor.values[6] - 1.0}


def test_noise_of_the_voltage_sensor_is_removed_and_with_it_the_bias() -> None:
    """Least squares with a noisy regressor is biased; two per cent of noise suffice for L."""
    before, after = decided([with_noise(wavy(k), 0.3) for k in range(3)])
    assert after.voltage == "smoothed"
    assert [warning.code for warning in after.warnings] == ["smoothed_voltage"]
    with_bias, without = errors(MOTOR, before), errors(MOTOR, after)
    assert abs(with_bias["L"]) > 0.1
    assert abs(without["L"]) < 0.3 * abs(with_bias["L"])
    assert abs(without["Ra25"]) < 0.02
    assert np.std(after.validation[0].column("voltage") - wavy(2).voltage) < 0.2


@pytest.mark.parametrize("jitter", [0.0, 0.15])
def test_a_voltage_that_the_motor_follows_is_kept(jitter: float) -> None:
    """Without noise nothing is gained, and a jitter at the motor shows in its current."""
    before, after = decided([wavy(k, jitter) for k in range(3)])
    assert after is before


def test_the_hold_of_a_noisy_voltage_is_not_taken_for_a_delay() -> None:
    """The voltage changes linearly between samples; no effect is named, Ra25 is right."""
    runs = [with_noise(wavy(k), 0.3) for k in range(3)]
    result = identify(runs[:2], runs[2:], FitOptions(posterior=False)).result
    assert result["declared"]["hold"] == "foh"
    assert result["effects"] == []
    for name, value in zip(("Ra25", "Kt25"), (MOTOR.values[0], MOTOR.values[2]), strict=True):
        assert result["parameters"][name]["mean"] == pytest.approx(value, rel=0.05)


def test_noise_left_in_the_voltage_causes_a_current_of_known_power() -> None:
    """A resistance three times as large passes a ninth of the noise at high frequency, not less."""
    _, campaign = decided([with_noise(wavy(k), 0.3) for k in range(3)])
    fit = fit_declared(campaign.training, "foh")
    more = fit.values * np.where(np.arange(fit.values.size) == 0, 3.0, 1.0)
    larger = replace(fit, position=fit.coordinates.of(more))
    ratio = voltage_noise_power(larger)[0] / voltage_noise_power(fit)[0]
    assert 1.0 / 9.0 <= ratio < 1.0
    clean = fit_declared(campaign_of([wavy(0)], []).training, "foh")
    assert not voltage_noise_power(clean).any()


def test_an_effect_gains_nothing_by_suppressing_the_noise_of_the_voltage() -> None:
    """Two models whose squares differ as the noise that they pass fit equally well."""
    _, campaign = decided([with_noise(wavy(k), 0.3) for k in range(3)])
    passing = evaluated(fit_declared(campaign.training, "foh"), campaign, 1.0)
    less = 0.5 * passing.noise
    weighting = passing.fit.weighting
    deviation = np.sqrt(weighting.deviation**2 - less)
    cost = passing.fit.cost + float(weighting.counts @ np.log(deviation / weighting.deviation))
    assert passing.unseen is not None
    suppressing = replace(
        passing,
        fit=replace(passing.fit, cost=cost, weighting=replace(weighting, deviation=deviation)),
        unseen=replace(passing.unseen, square=passing.unseen.square - less),
        noise=passing.noise - less,
    )
    assert suppressing.fit.cost < passing.fit.cost
    assert suppressing.criteria(passing, 1).gain == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(scores_of([suppressing, passing])) == pytest.approx(0.0, abs=1e-6)


def test_a_prediction_removes_the_noise_as_the_fit_did() -> None:
    """The predicted current is closer to the true one than with the noise of the log."""
    true = wavy(2)
    runs = [with_noise(run, 0.3) for run in (wavy(0), wavy(1), true)]
    options = FitOptions(effects=False, posterior=False)
    result = identify(runs[:2], options=options).result
    assert result["declared"]["voltage"] == "smoothed"
    as_logged = result | {"declared": result["declared"] | {"voltage": "logged"}}
    smooth, noisy = (
        np.std(predict(one, runs[2])["current_A"] - true.current) for one in (result, as_logged)
    )
    assert smooth < 0.5 * noisy


def test_the_steps_of_a_slow_voltage_are_smoothed_and_widen_the_intervals() -> None:
    """While a level is held, half a step of 0.5 V changes the speed by many times its noise.

    Neither a curve over time nor a delay is named, and the true motor is within the intervals.
    """
    runs = [knob(k, 0.5) for k in range(3)]
    result = identify(runs[:2], runs[2:], FitOptions(posterior=False)).result
    assert result["declared"]["voltage"] == "smoothed"
    assert result["effects"] == []
    codes = [warning["code"] for warning in result["warning_details"]]
    assert "coarse_quantisation" in codes
    assert "voltage_noise" in {term["name"] for term in result["diagnosis"]["omitted"]}
    for name, value in zip(("Ra25", "Kt25", "J"), MOTOR.values[0:5:2], strict=True):
        found = result["parameters"][name]
        assert abs(found["mean"] - value) < 3.0 * found["sd"]


def test_the_steps_of_a_supply_are_kept() -> None:
    """The current shows that the motor receives the steps."""
    before, after = decided([knob(k, 0.5, follows=True) for k in range(3)])
    assert after is before


@pytest.mark.parametrize(("share", "is_refused"), [(0.9, True), (1.1, False)])
def test_a_curve_has_to_explain_more_than_the_noise_of_the_voltage(
    share: float, is_refused: bool
) -> None:
    """Both variances are lower with the curve, by a share of what the noise causes."""
    _, campaign = decided([knob(k, 0.5) for k in range(3)])
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    score = next(s for s in trials.curves(nominal) if s.candidate.tried is None)
    ((_, fit),) = trials.refits(nominal, [score])
    curve = trials.evaluate(fit)
    deviation = np.sqrt(fit.weighting.deviation**2 + share * curve.noise)
    weighting = replace(nominal.fit.weighting, deviation=deviation)
    simpler = replace(nominal, fit=replace(nominal.fit, weighting=weighting), noise=curve.noise)
    refusal = curve.criteria(simpler, 1).refusal
    assert ("no more than noise of the voltage" in refusal) == is_refused
