"""Start of refits: along the direction that the score predicts, from the best prototype."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import EffectRequest, Noise, make_campaign
from identification.effects.catalogue import CATALOGUE
from identification.effects.electrical import BrushDrop
from identification.effects.load import LoadTorque
from identification.effects.sensor import ChannelDelay, CurrentFilter
from identification.effects.thermal import Demagnetization, SelfHeating
from identification.effects.zero import VoltageOffset
from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.solve import TerminationLimits, solve
from identification.model.parameter import Coordinates
from identification.model.weighting import Weighting
from identification.selection.candidates import scales_of
from identification.selection.policy import SelectionPolicy
from identification.selection.refit import refitted_as, refitted_with, refitted_without, swapped
from identification.selection.score import sized
from identification.selection.screen import screened
from identification.selection.start import Start, begun, has_odd_coefficients, traded
from identification.selection.tracing import missing_curves
from identification.surrogates.run_in import ViscousFrictionOfRuns
from identification.work import Budget, metered, operations
from tests.effects.hidden import records_of_bench


def campaign(effect: str, size: float, seed: int, law: str | None = None) -> Campaign:
    """Three training runs and a validation run of a servo motor with a hidden effect."""
    measured = make_campaign(
        "servo_150w",
        [EffectRequest(effect, size=size, law=law)],
        seed=seed,
        rows=1200,
        training=3,
        validation=1,
    )
    return records_of_bench(measured)


def test_parameters_move_as_the_score_predicts() -> None:
    """A small load is nearly linear; the reference is the complete refit."""
    declared = fit_declared(campaign("load_torque", 0.002, seed=31).training, "zoh")
    (score,) = screened(declared, LoadTorque.candidates(scales_of(declared))[:1])

    refit = refitted_with(declared, score.candidate.final, score.starts)

    assert score.along is not None
    moved = refit.position[: declared.position.size] - declared.position
    share = float(refit.values[-1] / score.start[0])
    spread = np.sqrt(np.diag(np.linalg.inv(declared.equations.matrix)))
    assert share == pytest.approx(1.0, abs=0.05)
    assert np.abs(moved - share * score.along.position).max() < 0.5 * spread.max()
    assert np.abs((moved - share * score.along.position) / spread).max() < 0.5


def test_no_predicted_gain_exceeds_the_residual() -> None:
    """No effect removes more than the whole weighted residual, even from a poor fit."""
    declared = fit_declared(campaign("coulomb_friction", 0.05, seed=34).training, "zoh")
    white = Weighting.white(declared.simulator.records)
    white = replace(white, deviation=declared.weighting.deviation)
    away = declared.position.copy()
    away[declared.coordinates.names.index("Kt25")] += 0.05
    astray = solve(
        declared.simulator, declared.coordinates, away, declared.states, white, TerminationLimits(0)
    )
    deviation = astray.weighting.deviation
    left = sum(0.5 * float(np.sum((r / deviation) ** 2)) for r in astray.residuals())

    scales = scales_of(astray)
    scores = screened(astray, [c for kind in CATALOGUE.values() for c in kind.candidates(scales)])

    assert scores
    assert max(score.gain for score in scores) < left


def test_every_fourth_sample_predicts_no_larger_gain() -> None:
    """A voltage offset is collinear with a fitted brush drop; this motor has none."""
    declared = fit_declared(campaign("brush_drop", 0.03, seed=35).training, "zoh")
    best = screened(declared, BrushDrop.candidates(scales_of(declared)))[0]
    fit = refitted_with(declared, best.candidate.final, best.starts, TerminationLimits())
    candidates = VoltageOffset.candidates(scales_of(fit))
    whole = max(score.gain for score in screened(fit, candidates))

    policy = SelectionPolicy(screening_samples=900)
    few = max(score.gain for score in screened(fit, candidates, policy))

    assert few < 4 * (whole + 5)


def test_the_curve_of_a_voltage_loss_is_fitted_for_a_motor_that_settles_within_a_sample() -> None:
    """The loss grows with i^2.5, so the outer spline coefficients are large.

    Clipped one by one, they made the start diverge: its comparison alone took 43 giga-operations,
    and nothing was gained.
    """
    request = EffectRequest("square_voltage_loss", 0.101, law="power_2.5")
    hidden = records_of_bench(make_campaign(14_010_313, [request], 14_000_313, rows=500))
    declared = fit_declared(hidden.training, "zoh")
    curve = missing_curves(declared)[0]

    with metered():
        limits = TerminationLimits(20, budget=Budget(1e10))
        fit = refitted_with(declared, curve.candidate.final, curve.starts, limits)

        assert operations() < 1.5e10
    assert curve.candidate.final.drivers == ("current",)
    assert np.all(fit.weighting.deviation < 0.5 * declared.weighting.deviation)


def test_amplitudes_scored_together_keep_their_ratio_at_a_start() -> None:
    """A zero error 50 times beyond its range, with a drift of two fifths of it per run."""
    declared = fit_declared(campaign("voltage_offset", 0.02, seed=37).training, "zoh")
    candidate = VoltageOffset.candidates(scales_of(declared))[-1]
    offset, _ = candidate.term.parameters
    reach = 3.0 * offset.prior_sd * offset.scale / candidate.starts[0, 0]

    start, weights = sized(candidate, 0, np.array([50.0 * reach, 200.0 * reach]))

    assert candidate.joint == 2
    assert start[1] / start[0] == pytest.approx(0.4)
    assert weights[1] / weights[0] == pytest.approx(4.0)
    assert abs(start[0]) <= 3.0 * offset.prior_sd * offset.scale * (1 + 1e-12)


def test_a_refit_goes_on_from_the_start_that_simulates_best() -> None:
    """True delay 1.2 samples: of three starts the nearest is chosen, not the first."""
    hidden = campaign("channel_delay", 0.12, seed=32, law="speed")
    declared = fit_declared(hidden.training, "zoh")
    interval = scales_of(declared).interval
    term = ChannelDelay("speed", 8, interval)
    starts = [Start(np.array([n * interval])) for n in (6.5, 3.5, 1.3)]
    model = declared.simulator.model.adding(term)
    coordinates = Coordinates([*declared.coordinates.parameters, model.parameters[-1]])
    noise = replace(
        Weighting.white(declared.simulator.records), deviation=declared.weighting.deviation
    )

    _, position, _ = begun(declared, model, coordinates, starts, noise)

    assert coordinates.values(position)[-1] / interval == pytest.approx(1.3, abs=0.05)


def test_amplitudes_of_each_record_that_are_too_large_are_reduced() -> None:
    """Known: no viscous friction differs between the runs; its start is far too large."""
    declared = fit_declared(campaign("brush_drop", 0.001, seed=37).training, "zoh")
    size = 10.0 * declared.by_name["b"]
    model = declared.simulator.model.adding(ViscousFrictionOfRuns(size))
    start = Start(np.zeros(0), own=tuple(np.array([each * size]) for each in (1.0, -1.0, 2.0)))
    noise = replace(
        Weighting.white(declared.simulator.records), deviation=declared.weighting.deviation
    )

    _, _, states = begun(declared, model, declared.coordinates, [start], noise)

    assert max(abs(float(state[-1])) for state in states) < 0.01 * size


def test_the_start_of_a_demagnetisation_has_most_of_its_gain() -> None:
    """Moving Kt along gives half of the predicted gain more than a start with fixed Kt."""
    declared = fit_declared(campaign("demagnetization", 0.06, seed=36).training, "zoh")
    score = screened(declared, Demagnetization.candidates(scales_of(declared)))[0]
    model = declared.simulator.model.adding(score.candidate.final)
    coordinates = Coordinates([*declared.coordinates.parameters, *model.parameters[-3:]])

    def cost(start: Start) -> float:
        simulator, position, states = begun(declared, model, coordinates, [start], noise)
        sums = simulator.misfit(coordinates.values(position)[:, None], states, noise)
        return float(noise.sized(sums)[1][0])

    noise = replace(
        Weighting.white(declared.simulator.records), deviation=declared.weighting.deviation
    )
    (along,) = score.starts

    assert cost(along) < cost(replace(along, along=None)) - 0.5 * score.gain


def test_validation_runs_remember_the_hottest_training_run() -> None:
    """They are recorded after the training runs, and demagnetisation is permanent."""
    hidden = campaign("demagnetization", 0.06, seed=33)
    hottest = max(float(record.column("temperature").max()) for record in hidden.training)

    for record in hidden.validation:
        assert float(record.column("peak_temperature")[0]) >= hottest


def test_a_winding_that_heats_itself_is_fitted_though_resistance_seemed_to_fall() -> None:
    """Without self-heating alpha_Ra is negative, from where no heating can raise Ra."""
    hidden = [("self_heating", 0.3)]
    measured = make_campaign("servo_150w", hidden, seed=31, rows=1200, training=4, validation=1)
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    (candidate,) = SelfHeating.candidates(scales_of(declared))

    fit = refitted_with(declared, candidate.term, [Start(start) for start in candidate.starts.T])

    assert declared.values[1] < 0.0
    assert has_odd_coefficients(declared)
    assert fit.values[1] > 0.5 * measured.truth["parameters"]["alpha_Ra"]
    assert fit.weighting.deviation[0] < 0.2 * declared.weighting.deviation[0]


def test_an_inductance_returns_to_its_value_when_the_filter_is_added() -> None:
    """From the nominal fit, with five times the true L, the fit stopped at seven noises."""
    measured = make_campaign(
        8_010_110,
        [EffectRequest("current_filter", size=0.2276)],
        seed=8_000_110,
        rows=600,
        noise=Noise(kind="spiky"),
        position="incremental",
    )
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    candidate = CurrentFilter.candidates(scales_of(declared))[0]
    (score,) = screened(declared, [candidate])[:1]

    without = refitted_with(declared, candidate.term, score.starts)
    fit = refitted_with(declared, candidate.term, [*score.starts, *traded(declared, candidate)])

    truth = measured.truth["parameters"]["L"]
    noise = [measured.truth["noise"][name] for name in ("current_A", "speed_rad_s")]
    at = fit.coordinates.names.index("L")
    assert np.all(fit.weighting.deviation < 1.3 * np.array(noise))
    assert fit.values[at] == pytest.approx(truth, rel=0.05)
    assert without.values[at] > 2.0 * truth


def test_a_delay_of_zero_is_removed_without_a_rise_of_the_cost() -> None:
    """Runs that start under full voltage, with current and speed far from those 8 samples later.

    A voltage delay of zero is the nominal model.  It costs the same except for the edge samples of
    the delay, before any step of the optimiser.
    """
    runs = campaign("load_torque", 0.0, seed=31).training
    declared = fit_declared(runs, "zoh")
    delay = ChannelDelay("voltage", 8, scales_of(declared).interval)
    late = refitted_with(declared, delay, [Start(np.zeros(1))])

    bare = refitted_without(late, "channel_delay", TerminationLimits(0))

    assert bare.cost < declared.cost + 10.0


def test_a_law_that_is_no_candidate_starts_at_its_values_in_a_rival() -> None:
    """Two thermal bodies refine self-heating, so no score test without it proposes them."""
    declared = fit_declared(campaign("self_heating", 8.0, seed=37).training, "zoh")
    score = screened(declared, SelfHeating.candidates(scales_of(declared)))[0]
    fit = refitted_with(declared, score.candidate.final, score.starts)
    (heat,) = fit.simulator.model.terms
    assert isinstance(heat, SelfHeating)
    bodies = heat.richer[0]
    rival = refitted_as(fit, bodies, TerminationLimits(3))

    found = swapped(fit, heat, bodies, rival, TerminationLimits(3))

    assert found.simulator.model.terms == (bodies,)
    assert found.cost < declared.cost


def test_fit_below_a_sufficient_cost_ends_with_a_slight_step() -> None:
    """Near the optimum each step gains less than the one before: less than 1 is left to gain."""
    declared = fit_declared(campaign("brush_drop", 0.03, seed=35).training, "zoh")
    best = screened(declared, BrushDrop.candidates(scales_of(declared)))[0]
    spent, fits = [], []
    for sufficient in (-np.inf, np.inf):
        limits = TerminationLimits(sufficient=sufficient)
        with metered():
            fits.append(refitted_with(declared, best.candidate.final, best.starts, limits))
            spent.append(operations())

    converged, ended = fits
    assert 0.0 <= ended.cost - converged.cost < 1.0
    assert spent[1] < spent[0]
