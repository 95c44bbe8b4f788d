"""Laws of the saturation of Kt and L by the current."""

from __future__ import annotations

import pytest

from bench import EffectRequest, make_campaign
from identification.effects.electrical import FluxSaturation
from identification.fit.declared import fit_declared
from identification.selection.steps import State, enrich
from identification.selection.trials import Trials
from tests.effects.hidden import records_of_bench


@pytest.mark.parametrize("is_exponential", [False, True])
def test_the_law_of_a_saturation_does_not_bias_kt(is_exponential: bool) -> None:
    """The law that the search tries first misses Kt25 by several standard deviations."""
    law = "exponential" if is_exponential else "rational"
    request = EffectRequest("flux_saturation", 0.06, law=law)
    measured = make_campaign(88, [request], seed=3, rows=500)
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    score = next(s for s in trials.scores(nominal) if s.candidate.term.name == "flux_saturation")
    (model,) = trials.finish_best(nominal, trials.refits(nominal, [score]))
    state = State(trials, nominal, model)

    enrich(state)

    fit = state.current.fit
    (term,) = fit.simulator.model.terms
    assert isinstance(term, FluxSaturation)
    assert term.is_exponential is is_exponential
    at = list(fit.coordinates.names).index("Kt25")
    sd = fit.equations.covariance()[at, at] ** 0.5
    assert fit.by_name["Kt25"] == pytest.approx(measured.truth["parameters"]["Kt25"], rel=4 * sd)
