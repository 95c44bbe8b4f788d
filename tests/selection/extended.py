"""Models of simulated servos, extended by effects."""

from __future__ import annotations

from bench import make_campaign
from identification.fit.declared import fit_declared
from identification.selection.candidates import with_predicted_gain
from identification.selection.evidence import EvaluatedModel
from identification.selection.score import Score, gathered
from identification.selection.trials import Trials
from tests.effects.hidden import records_of_bench


def frictions() -> tuple[Trials, EvaluatedModel, dict[str, Score]]:
    """A servo with Coulomb friction, and the best score of each friction law."""
    measured = make_campaign(
        "servo_150w", ["coulomb_friction"], seed=12, rows=800, training=2, validation=1
    )
    trials = Trials(records_of_bench(measured))
    declared = trials.evaluate(fit_declared(trials.campaign.training, "zoh"))
    best: dict[str, Score] = {}
    for score in gathered(trials.scores(declared)):
        best.setdefault(score.candidate.term.name, score)
    return trials, declared, best


def extended(trials: Trials, model: EvaluatedModel, name: str) -> EvaluatedModel:
    """The model with an effect of this type added, or with a curve."""
    scores = trials.curves(model) if name == "unlisted" else trials.scores(model)
    scores = [s for s in scores if s.candidate.term.name == name]
    fits = trials.refits(model, with_predicted_gain(scores, 1))
    return trials.finish_best(model, fits)[0]
