"""Channels of which a model explains nothing, and what a result then says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification import FitOptions, identify
from identification.diagnosis.localise import localise
from identification.diagnosis.outliers import root_mean_square
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.result.findings import ResidualAnalysis
from identification.result.simulation_errors import worse_runs
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.outcome import Found, Outcome
from tests.motors import campaign, motor_named

RUNS = campaign(motor_named("servo 100 W"), seed=4)


def _of_another_time(run: Run) -> Run:
    """The run with a speed that has no relation to its voltage."""
    return replace(run, speed=np.roll(run.speed, run.rows // 2))


def _behind_noise(run: Run, seed: int) -> Run:
    """The run with white noise of three times the standard deviation of the speed."""
    noise = np.random.default_rng(seed).normal(0.0, 3.0 * run.speed.std(), run.rows)
    return replace(run, speed=run.speed + noise)


def _louder(run: Run, seed: int) -> Run:
    """The run with 1.4 times the noise of the speed, which is 1 % of its standard deviation."""
    added = np.sqrt(1.4**2 - 1.0) * 0.01 * run.speed.std()
    noise = np.random.default_rng(seed).normal(0.0, added, run.rows)
    return replace(run, speed=run.speed + noise)


def _analysis(runs: list[Run]) -> ResidualAnalysis:
    split = campaign_of(runs, ())
    fit = fit_declared(split.training, "zoh")
    return ResidualAnalysis(split, fit, fit, None, localise(fit))


def test_a_speed_of_another_recording_is_not_explained() -> None:
    """The estimate of its noise is as large as the signal; the autocorrelation decides."""
    missed = _analysis([_of_another_time(run) for run in RUNS]).missed

    assert list(missed) == ["speed"]
    assert missed["speed"]["noise_ratio"] is not None
    assert missed["speed"]["noise_ratio"] < 2.0


def test_a_small_missing_effect_is_no_noise() -> None:
    """One run with 1 % more Kt raises the error by 10 to 20 %; the estimate of the noise stays."""
    motor = motor_named("servo 100 W")
    ra, alpha_ra, kt, alpha_kt, j, b, inductance = motor.values
    odd = replace(motor, values=(ra, alpha_ra, 1.01 * kt, alpha_kt, j, b, inductance))
    runs = [*RUNS[:1], *campaign(odd, seed=4)[1:2], *RUNS[2:]]
    analysis = _analysis(runs)

    noise = 0.01 * np.array(
        [np.std(np.concatenate([getattr(r, name) for r in runs])) for name in ("current", "speed")]
    )
    error = root_mean_square(analysis.simulated["after"]["training"])
    assert np.all(error > 1.1 * noise)
    np.testing.assert_allclose(analysis.noise, noise, rtol=0.02)


def test_white_noise_larger_than_the_speed_is_explained() -> None:
    """The NRMSE is above 90 %, and the model is right."""
    analysis = _analysis([_behind_noise(run, seed) for seed, run in enumerate(RUNS)])

    (first, *_) = analysis.simulated["after"]["training"]
    assert np.std(first.residual[:, 1]) > 0.9 * np.std(first.record.measured[:, 1])
    assert analysis.missed == {}


def test_a_noisier_validation_run_does_not_make_a_true_effect_improbable() -> None:
    """Coulomb friction that the fit knows exactly; the last run has 1.4 times the noise."""
    split = campaign_of(RUNS[:2], [_louder(run, seed) for seed, run in enumerate(RUNS[2:])])
    fit = fit_declared(split.training, "zoh")
    criteria = AcceptanceCriteria(
        300.0, 15.0, 0.025, 0.025, 0.3, 60.0, False, unknowns=2, tried=400
    )
    outcome = Outcome(fit, (Found("coulomb_friction", 0.99, criteria, ()),), ())
    analysis = ResidualAnalysis(split, fit, fit, outcome, localise(fit))

    assert analysis.after is not None
    assert analysis.after.of("speed", "validation")[0].noise_ratio > 1.2
    assert analysis.judged is not None
    assert analysis.judged.effects[0].probability == 0.99


def test_an_effect_that_the_validation_runs_cannot_show_is_named() -> None:
    """A note for each effect of all runs whose odds they cannot reach; none for the others."""
    split = campaign_of(RUNS[:2], RUNS[2:])
    fit = fit_declared(split.training, "zoh")
    judged = AcceptanceCriteria(300.0, 15.0, 0.1, 0.1, 0.1, 60.0, False, expected=80.0)
    found = {
        "coulomb_friction": replace(judged, validation=0.0, log_odds=0.1, expected=0.5),
        "load_step": replace(judged, validation=0.0, log_odds=0.0, expected=0.0, local=True),
        "brush_drop": judged,
    }
    effects = tuple(Found(name, 0.99, criteria, ()) for name, criteria in found.items())
    analysis = ResidualAnalysis(split, fit, fit, Outcome(fit, effects, ()), localise(fit))

    (note,) = worse_runs(analysis)

    assert note.code == "effect_not_validated"
    assert "refute Coulomb friction:" in note.message


def test_nothing_is_certain_if_the_model_explains_nothing_of_the_speed() -> None:
    """The current needs dry friction without the speed, and the friction fits it very well."""
    options = FitOptions(posterior=False, force=True, effort="quick")

    result = identify([_of_another_time(run) for run in RUNS[:1]], (), options).result

    assert result["effects"]
    assert not any(effect["comparable"] for effect in result["effects"])
    entries = [result["parameters"], *(effect["parameters"] for effect in result["effects"])]
    assert not any(entry["identified"] for group in entries for entry in group.values())
    assert any("the NRMSE is" in warning for warning in result["warnings"])
    assert not any("it is improbable" in warning for warning in result["warnings"])
