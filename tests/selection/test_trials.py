"""Cost of the trials of a search: intermediate models are cheap, the final model is complete."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import EffectRequest, make_campaign
from identification.effects.effect import Candidate, effects_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits, continued
from identification.selection import search
from identification.selection import trials as trials_module
from identification.selection.candidates import with_predicted_gain
from identification.selection.evidence import EvaluatedModel, is_better
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.selection.steps import (
    State,
    accept,
    admissible,
    enrich,
    rivals_of,
    settled,
)
from identification.selection.trials import Trials
from identification.work import Budget, metered, operations
from tests.effects.hidden import records_of_bench
from tests.selection.extended import extended, frictions


def first_round(longest: float) -> tuple[Trials, EvaluatedModel, float]:
    """Servo with a brush drop: its model after the first round, and the operations spent."""
    measured = make_campaign(
        "servo_150w", ["brush_drop"], seed=12, rows=800, training=2, validation=1
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))
    drops = [s for s in trials.scores(declared) if s.candidate.term.name == "brush_drop"]
    refits = trials.refits(declared, with_predicted_gain(drops, 1))
    refits = [(score, replace(fit, converged=False)) for score, fit in refits]
    trials.longest = longest
    began = operations()
    (model, *_) = trials.finish_best(declared, refits)
    return trials, model, operations() - began


def test_model_of_a_round_costs_little_and_the_final_one_is_the_same() -> None:
    """The final fit completes once what the rounds cut short."""
    with metered():
        _, free, cost_of_free = first_round(np.inf)
        trials, capped, cost_of_capped = first_round(1e7)
        final = trials.final(capped)

    assert cost_of_capped < 0.7 * cost_of_free
    assert capped.fit.cost >= free.fit.cost
    assert final.cost == pytest.approx(free.fit.cost, rel=1e-3)


def test_behind_failed_candidates_the_best_of_those_that_pass_is_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The friction that the motor has, not another one whose refit comes before it."""
    trials, declared, best = frictions()
    wanted = [best["stribeck_friction"], best["coulomb_friction"]]
    fits = [(score, extended(trials, declared, score.candidate.term.name).fit) for score in wanted]
    monkeypatch.setattr(trials, "refits", lambda _, left, *__: fits if left else [])
    monkeypatch.setattr(trials, "finish_best", lambda *_: [])

    accepted = accept(State(trials, declared, declared), wanted)

    assert accepted is not None
    assert [term.name for term in accepted.fit.simulator.model.terms] == ["coulomb_friction"]


def test_a_model_that_was_only_compared_is_finished_if_it_becomes_the_final_one() -> None:
    """Beside a model that is better by 10,000, a fit five standard deviations off is exact enough.

    This happens if the better model has an effect that the validation runs refuse.
    """
    measured = make_campaign("servo_150w", [], seed=3, rows=400, training=1, validation=1)
    campaign = records_of_bench(measured)
    optimum = fit_declared(campaign.training, "zoh")
    covariance = optimum.equations.covariance()
    off = optimum.position + 5.0 * covariance[0] / np.sqrt(covariance[0, 0])
    limits = TerminationLimits(reference=optimum.cost - 1e4)
    compared = continued(replace(optimum, position=off), limits)
    trials = Trials(campaign)

    final = trials.final(trials.evaluate(compared))

    assert compared.converged
    assert compared.cost > optimum.cost + 10.0
    assert final.cost == pytest.approx(optimum.cost, abs=0.01)


@pytest.mark.parametrize(("law", "is_creeping"), [("soft", True), (None, False)])
def test_friction_that_creeps_before_it_slides_is_told_from_a_sharp_one(
    law: str | None, is_creeping: bool
) -> None:
    """With a sharp sign only, the creep would be left to other effects."""
    request = EffectRequest("coulomb_friction", 0.1, law)
    measured = make_campaign("servo_150w", [request], seed=5, rows=800, training=2, validation=1)
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))
    scores = [s for s in trials.scores(declared) if s.candidate.term.name == "coulomb_friction"]
    (model,) = trials.finish_best(declared, trials.refits(declared, scores))
    state = State(trials, declared, model)

    enrich(state)

    (term,) = effects_of(state.current.fit.simulator.model.terms)
    assert term.name == "coulomb_friction"
    assert ("coulomb_friction.creep" in state.current.fit.by_name) is is_creeping


def ripple_of_current(seed: int, amplitude: float, rows: int) -> tuple[float, float]:
    """Gain that a ripple predicts, and that which justifies its refit.

    The current has white noise and a sine of 20 Hz, relative to the noise.
    """
    measured = make_campaign("servo_150w", [], seed=seed, rows=rows, training=1, validation=0)
    campaign = records_of_bench(measured)
    (record,) = campaign.training
    noise = np.std(np.diff(record.measured[:, 0], 3)) / np.sqrt(20.0)
    wave = amplitude * noise * np.sin(2.0 * np.pi * 20.0 * record.time)
    record = replace(record, measured=record.measured + np.column_stack([wave, 0.0 * wave]))
    trials = Trials(replace(campaign, training=(record,)))
    declared = trials.evaluate(fit_declared((record,), "zoh"))
    best = max(
        (s for s in trials.curves(declared) if s.structure[1].startswith("periodic in time")),
        key=lambda score: score.gain,
    )
    factor = trials.policy.curve_underestimate
    return best.gain, trials.worth_a_refit(declared, factor, best.unknowns(1))


def test_a_ripple_that_white_noise_has_by_chance_justifies_no_refit() -> None:
    """The largest of hundreds of frequencies gains the logarithm of their number, about 6."""
    found = [ripple_of_current(seed, 0.0, 370) for seed in range(4)]

    assert all(3.0 < gain < needed for gain, needed in found)


def test_a_ripple_of_half_the_noise_justifies_a_refit() -> None:
    """Its gain is about N / 4 times the square of the ratio to the noise."""
    gain, needed = ripple_of_current(0, 0.5, 1500)

    assert gain > max(needed, 1500 / 4 * 0.5**2)


def test_a_kind_far_behind_the_best_is_refitted_only_by_itself() -> None:
    """Five times a tenth of the gain of the brush drop is less than 85 % of it."""
    measured = make_campaign(
        "servo_150w", ["brush_drop"], seed=12, rows=800, training=2, validation=1
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))
    scores = trials.scores(declared)
    drop = next(s for s in scores if s.candidate.term.name == "brush_drop")
    ((_, fit),) = trials.refits(declared, [drop])
    gained = declared.fit.cost - fit.cost
    other = next(s for s in scores if s.candidate.term.name == "coulomb_friction")
    weak = replace(other, gain=0.1 * gained)

    both = trials.refits(declared, [drop, weak])
    alone = trials.refits(declared, [weak])

    assert [score.candidate.term.name for score, _ in both] == ["brush_drop"]
    assert [score.candidate.term.name for score, _ in alone] == ["coulomb_friction"]


def test_nothing_is_refitted_that_cannot_come_near_a_rival() -> None:
    """A rival with six times the predicted gain exceeds the limit of five times."""
    measured = make_campaign(
        "servo_150w", ["brush_drop"], seed=12, rows=800, training=2, validation=1
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))
    best = trials.scores(declared)[0]
    began = operations()

    assert trials.refits(declared, [best], declared.fit.cost - 6.0 * best.gain) == []
    assert operations() == began


def test_a_search_that_was_cut_short_names_the_better_of_two_kinds_it_knows() -> None:
    """Dry friction is hidden and evaluated; the current model has a quadratic drag instead."""
    measured = make_campaign(
        "servo_150w", ["coulomb_friction"], seed=12, rows=800, training=2, validation=1
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))
    judged = {}
    for name in ("coulomb_friction", "quadratic_drag"):
        scores = [s for s in trials.scores(declared) if s.candidate.term.name == name]
        (judged[name], *_) = trials.finish_best(
            declared, trials.refits(declared, with_predicted_gain(scores, 1))
        )
    state = State(trials, declared, judged["quadratic_drag"])
    trials.budget = Budget(0.0)

    (found,) = search._effects_of(state)

    assert trials.budget.spent
    assert found.name == "coulomb_friction"
    assert found.probability > 0.95
    assert [term.name for term in state.current.fit.simulator.model.terms] == ["coulomb_friction"]


def test_a_friction_that_gained_more_than_predicted_raises_the_limit_of_other_frictions() -> None:
    """The policy's limit holds for a ratio of one; a ratio of ten multiplies it by ten."""
    trials, declared, best = frictions()
    coulomb, drag = best["coulomb_friction"], best["quadratic_drag"]
    ((_, fit),) = trials.refits(declared, [coulomb])
    scored = replace(coulomb, gain=(declared.fit.cost - fit.cost) / 10.0)
    trials._scores = {key: [scored, drag] for key in trials._scores}
    limit = trials.policy.underestimate

    assert trials.underestimate(declared, drag.candidate.term) == pytest.approx(10.0 * limit)
    assert trials.underestimate(declared, best["brush_drop"].candidate.term) == limit


def test_an_unfinished_fit_of_the_true_friction_is_finished_before_a_friction_is_named() -> None:
    """Coulomb friction is hidden; its fit had stopped at a fifth of its torque, behind the drag."""
    trials, declared, best = frictions()
    ((score, fit),) = trials.refits(declared, [best["coulomb_friction"]])
    (drag,) = trials.finish_best(declared, trials.refits(declared, [best["quadratic_drag"]]))
    at = fit.coordinates.names.index("coulomb_friction.torque")
    position = fit.position.copy()
    position[at] *= 0.2
    cost = drag.fit.cost + 100.0
    trials.evaluate(replace(fit, position=position, cost=cost, converged=False))
    trials.budget = Budget(0.0)

    (found,) = search._effects_of(State(trials, declared, drag))

    assert score.candidate.term.name == found.name == "coulomb_friction"
    assert found.probability > 0.95


def test_a_rival_whose_effects_were_accepted_in_another_order_competes_with_its_own_effect() -> (
    None
):
    """The rival found the Stribeck friction first; the brush drop is common to both models."""
    measured = make_campaign(
        "servo_150w", ["coulomb_friction", "brush_drop"], seed=5, rows=800, training=2, validation=1
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    drop = extended(trials, nominal, "brush_drop")
    current = extended(trials, drop, "coulomb_friction")
    first = extended(trials, nominal, "stribeck_friction")
    rival = extended(trials, first, "brush_drop")
    unfinished = replace(rival, fit=replace(rival.fit, converged=False))
    (*_, friction) = current.fit.simulator.model.terms

    finished = settled(State(trials, nominal, current), unfinished, drop, friction)

    assert [term.name for term in finished.fit.simulator.model.terms] == [
        "brush_drop",
        "stribeck_friction",
    ]


@pytest.mark.parametrize(
    "other", [EffectRequest("cogging_torque", size=0.15), EffectRequest("brush_drop")]
)
def test_a_friction_whose_fit_was_stopped_is_fitted_again_from_the_optimum_of_its_rival(
    monkeypatch: pytest.MonkeyPatch, other: EffectRequest
) -> None:
    """Coulomb friction and another effect are hidden; without friction, the parameters are far."""
    measured = make_campaign(
        "servo_150w",
        [other, "coulomb_friction"],
        seed=17,
        rows=800,
        training=2,
        validation=1,
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    simpler = extended(trials, nominal, other.name)
    current = extended(trials, simpler, "stribeck_friction")

    def hardly(
        fit: Fit, candidate: Candidate, starts: list[Start], limits: TerminationLimits
    ) -> Fit:
        return refitted_with(fit, candidate.final, starts, TerminationLimits(0))

    with monkeypatch.context() as patched:
        patched.setattr(trials_module, "fitted_candidate", hardly)
        coulomb = [s for s in trials.scores(simpler) if s.structure[0] == "coulomb_friction"]
        ((_, stuck),) = trials.refits(simpler, coulomb[:1])

    rivals = rivals_of(State(trials, nominal, current), simpler, "stribeck_friction")

    (found,) = (r for r in rivals if r.effects_added_to(simpler)[0].name == "coulomb_friction")
    assert stuck.cost > found.fit.cost + 100.0
    assert found.fit.cost < current.fit.cost + 10.0


@pytest.mark.parametrize(("fall", "is_admitted"), [(0.001, False), (0.05, True)])
def test_a_curve_that_fits_only_as_well_as_a_friction_is_that_friction(
    fall: float, is_admitted: bool
) -> None:
    """Its error is smaller by 0.1 % and 5 %; it gains 60 more in log likelihood in both cases."""
    trials, declared, best = frictions()
    refits = trials.refits(declared, [best["coulomb_friction"]])
    (friction,) = trials.finish_best(declared, refits)
    curve = extended(trials, declared, "unlisted")
    noise = friction.fit.weighting.deviation * np.exp(-fall)
    weighting = replace(curve.fit.weighting, deviation=noise)
    fit = replace(curve.fit, cost=friction.fit.cost - 60.0, weighting=weighting)
    assert friction.unseen is not None
    unseen = replace(friction.unseen, square=friction.unseen.square * np.exp(-2.0 * fall))
    better = replace(curve, fit=fit, unseen=unseen, fraction=1.0)

    found = admissible(State(trials, declared, friction), [better], declared)

    assert is_better(better, friction)
    assert (found == [better]) is is_admitted
