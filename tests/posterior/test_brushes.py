"""Posterior of brushes with three shape parameters: chain length and identifiability."""

from __future__ import annotations

import numpy as np
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
from identification.selection.candidates import scales_of
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start


def brushes_fitted(size: float, seed: int) -> Fit:
    """Fit of a servo motor with a brush drop of this fraction of rated voltage."""
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
    """A parameterisation by 1 / openness had an autocorrelation time of 25 steps.

    A chain in which one walker stays in the tail for long has twice the time of the others.
    """
    posterior = Posterior(fit, 1.0)

    found = [sample(posterior, seed, most_steps=600).convergence for seed in range(3)]

    assert sum(convergence.reached for convergence in found) >= 2
    assert np.median([convergence.autocorrelation_time for convergence in found]) < 8.0


def test_a_shape_is_identified_if_the_runs_narrow_its_bounds(fit: Fit) -> None:
    """Openness may be close to zero, so the ratio of value to deviation is no criterion."""
    answer = identified(fit, 1.0)

    assert answer["brush_drop.openness"]
    assert not identified(fit, 1e-4)["brush_drop.openness"]
