"""Detection of model deficiency: false alarm rate of complete models, power for small effects."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from identification.diagnosis.detection import LEVEL, Detection, detect
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.evaluate import simulate_fitted, simulate_unseen
from identification.ingest.run import Run
from tests.diagnosis.test_localise import SERVO, SIZE, cold, noisy, pushed
from tests.motors import noiseless


def detected(runs: list[Run], noise: np.ndarray = SIZE) -> Detection:
    """Nominal model fitted to three runs and tested on the other two."""
    campaign = campaign_of(runs[:3], runs[3:])
    fit = fit_declared(campaign.training, "zoh")
    return detect(fit, simulate_fitted(fit), simulate_unseen(fit, campaign.validation), noise)


def rubbed(seed: int, friction: float) -> list[Run]:
    """Runs with Coulomb friction of the given size [N m] and white noise."""
    made = []
    for run in [*cold(seed), *cold(seed + 1)[:2]]:
        missing = np.zeros((run.rows, 2))
        missing[:, 1] = -friction * np.sign(run.speed)
        made += pushed(SERVO, [run], missing)
    return noisy(made, "white", 30 + seed)


@pytest.mark.parametrize("kind", ["white", "coloured", "spiky"])
def test_a_complete_model_is_rarely_called_incomplete(kind: str) -> None:
    """At level 1 %, two alarms in twelve campaigns have a probability below 1 %."""
    alarms = [
        detected(noisy(noiseless(SERVO, seed=seed, runs=5, rows=500), kind, 70 + seed)).missing
        for seed in range(12)
    ]

    assert LEVEL == 0.01
    assert sum(alarms) <= 1


def test_coloured_noise_needs_its_wider_band() -> None:
    """Negative control: a pole of 0.9 multiplies the variance by (1 + 0.81) / (1 - 0.81)."""
    runs = noiseless(SERVO, seed=3, runs=5, rows=500)

    white, coloured = (detected(noisy(runs, kind, 90)) for kind in ("white", "coloured"))

    narrow, wide = (np.square(d.checks[0].noise_ratio_limit - 0.02) - 1 for d in (white, coloured))
    assert wide / narrow == pytest.approx(np.sqrt(1.81 / 0.19), rel=0.3)


def test_dry_friction_of_a_hundredth_of_the_stall_torque_is_detected() -> None:
    """The stall torque is 24 V / 0.6 ohm x 0.07 N m/A = 2.8 N m; four of four are detected."""
    found = [detected(rubbed(seed, 0.028)) for seed in range(4)]

    assert all(d.missing for d in found)
    assert all(d.sentence.startswith("The model does not explain") for d in found)


def test_a_noise_that_is_half_of_the_true_one_shows_in_every_channel() -> None:
    """With half the true noise level, all four checks show a noise ratio of 2."""
    found = detected(noisy(noiseless(SERVO, seed=4, runs=5, rows=500), "white", 80), SIZE / 2)

    assert [check.role for check in found.checks] == ["training"] * 2 + ["validation"] * 2
    assert [check.channel for check in found.checks] == ["current", "speed"] * 2
    for check in found.checks:
        assert check.noise_ratio == pytest.approx(2.0, rel=0.05)
        assert not check.passed
        assert "times the sensor noise" in check.reason


def test_a_model_that_changed_after_training_fails_on_validation_alone() -> None:
    """If the resistance rises by a third before the validation runs, only their checks fail."""
    hot = dataclasses.replace(SERVO, values=(1.3 * SERVO.values[0], *SERVO.values[1:]))
    clean = [
        *noiseless(SERVO, seed=5, runs=3, rows=500),
        *noiseless(hot, seed=6, runs=2, rows=500),
    ]

    found = detected(noisy(clean, "white", 81))

    assert found.missing
    assert [check.passed for check in found.checks[:2]] == [True, True]
    assert not all(check.passed for check in found.checks[2:])


@pytest.mark.parametrize("kind", ["white", "coloured"])
def test_a_noisier_sensor_in_the_validation_runs_is_recognised_by_white_noise(kind: str) -> None:
    """Its noise is a third larger.  Coloured noise may as well be the error of the model."""
    runs = noiseless(SERVO, seed=9, runs=5, rows=800)

    found = detected(noisy(runs[:3], "white", 84) + noisy(runs[3:], kind, 85, louder=1.33))

    assert all(found.of(channel, "validation")[0].is_too_large for channel in ("current", "speed"))
    assert found.noisier == (("current", "speed") if kind == "white" else ())


def test_friction_that_only_the_validation_runs_have_is_no_noise() -> None:
    """Dry friction of a hundredth of the stall torque appears after the training runs."""
    clean = noisy(cold(10), "white", 86)

    found = detected(clean + rubbed(10, 0.028)[3:])

    assert found.of("speed", "validation")[0].is_too_large
    assert not found.is_noise("speed", "validation")


def test_without_validation_runs_there_are_two_checks() -> None:
    """Without validation runs, only the two training channels are tested."""
    found = detected(noisy(noiseless(SERVO, seed=7, runs=3, rows=500), "white", 82))

    assert [check.role for check in found.checks] == ["training", "training"]
    assert not found.missing
    assert "validation" not in found.sentence


def test_a_channel_that_was_not_measured_passes() -> None:
    """A speed channel that is zero throughout is not tested."""
    runs = [
        dataclasses.replace(run, speed=np.zeros(run.rows))
        for run in noisy(noiseless(SERVO, seed=8, runs=3, rows=500), "white", 83)
    ]

    found = detected(runs)

    assert found.checks[1].passed
    assert found.checks[1].reason == "not measured"
