"""A coarser simulation leaves the posterior unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.electrical import BrushDrop
from identification.effects.friction import CoulombFriction
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.model.substeps import evenly
from identification.posterior.density import Posterior, coarser
from identification.selection.candidates import scales_of
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start
from tests.motors import campaign, motor_named


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Fit of a motor whose brush knee requires substeps."""
    measured = make_campaign(
        "servo_150w", [("brush_drop", 0.03)], seed=5, rows=1500, training=2, validation=1
    )
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    declared = fit_declared(campaign_of(runs, []).training, "zoh")
    (candidate,) = BrushDrop.candidates(scales_of(declared))
    return refined(refitted_with(declared, candidate.term, [Start(candidate.starts[:, 1])]))


def rows(simulator: object) -> int:
    """Number of substeps of all records."""
    return sum(inputs.shape[0] for inputs in simulator.inputs)  # type: ignore[attr-defined]


def test_at_the_optimum_every_coarse_simulation_has_the_same_residual(fit: Fit) -> None:
    """The measured values are corrected by the difference of coarse and fine simulation."""
    expected = fit.residuals()
    found = list(coarser(fit.simulator, fit.values, fit.states, fit.weighting.deviation))

    assert found
    for simulator in found:
        assert rows(simulator) < rows(fit.simulator)
        logged = simulator.logged(fit.values[:, None], fit.states)
        for record, simulated, residual in zip(simulator.records, logged, expected, strict=True):
            np.testing.assert_allclose(
                record.measured - simulated[:, :, 0], residual, atol=1e-9 * record.span.max()
            )


def test_a_smoother_model_has_the_residual_of_the_sharp_one() -> None:
    """Friction with a ten times wider sign replaces the sharp one in the posterior."""
    records = records_of(campaign(motor_named("servo 100 W"), seed=4, runs=2, rows=800))
    declared = fit_declared(records, "zoh")
    friction = CoulombFriction(torque_size=0.1, width=1.0)
    smooth = declared.simulator.model.adding(friction)
    sharp = declared.simulator.model.adding(friction.sharper)
    values = np.append(declared.values, [0.01, 0.0])
    fine = declared.simulator.changed_to(sharp, values)
    fine = replace(fine, substeps=evenly([800, 800], 16))
    deviation = declared.weighting.deviation
    expected = fine.logged(values[:, None], declared.states)

    found = list(coarser(fine, values, declared.states, deviation, smooth))

    assert found
    for simulator in found:
        assert simulator.model == smooth
        logged = simulator.logged(values[:, None], declared.states)
        for given, corrected, a, b in zip(
            fine.records, simulator.records, expected, logged, strict=True
        ):
            residual = given.measured - a[:, :, 0]
            np.testing.assert_allclose(corrected.measured - b[:, :, 0], residual, atol=1e-9)


def test_the_density_falls_as_that_of_the_fine_simulation_does(fit: Fit) -> None:
    """The draws differ from those of the selection; 20 % allows for their scatter."""
    posterior = Posterior(fit, 1.0)
    root = np.linalg.cholesky(posterior.covariance())
    normal = np.random.default_rng(8).standard_normal((24, root.shape[0]))
    points = posterior.mirrored(np.vstack([posterior.centre, posterior.centre + normal @ root.T]))

    coarse = posterior(points)
    fine = posterior._density(fit.simulator, points)

    error = (coarse - coarse[0]) - (fine - fine[0])
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean((fine - fine[0]) ** 2))
