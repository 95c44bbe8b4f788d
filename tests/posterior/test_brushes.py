"""Brushes whose knee has three shape parameters are sampled as quickly as a motor without."""

from __future__ import annotations

import pytest

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.electrical import BrushDrop
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.posterior.density import Posterior
from identification.posterior.sample import sample
from identification.selection.refit import refined, refitted_with
from identification.selection.scales import scales_of
from identification.selection.start import Start


def brushes_fitted(size: float, seed: int) -> Fit:
    """A servo motor whose brushes take this share of the rated voltage."""
    measured = make_campaign(
        "servo_150w", [("brush_drop", size)], seed=seed, rows=1500, training=2, validation=1
    )
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    declared = fit_declared(campaign_of(runs, []).training, "zoh")
    (candidate,) = BrushDrop.candidates(scales_of(declared))
    return refined(refitted_with(declared, candidate.term, [Start(candidate.starts[:, 0])]))


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Brushes with a smooth knee."""
    return brushes_fitted(0.06, seed=6)


def test_their_chain_is_short(fit: Fit) -> None:
    """A knee in terms of 1 / openness took 25 steps from one draw to the next."""
    convergence = sample(Posterior(fit, 1.0), seed=0, most_steps=600).convergence

    assert convergence.reached
    assert convergence.autocorrelation_time < 10.0


def test_a_shape_within_bounds_is_known_where_the_runs_say_more_than_the_bounds(fit: Fit) -> None:
    """Openness may be near nothing, so that its size over its deviation says little."""
    answer = identified(fit, 1.0)

    assert answer["brush_drop.openness"]
    assert not identified(fit, 1e-4)["brush_drop.openness"]
