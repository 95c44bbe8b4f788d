"""Proposals with known density: a chain of them alone samples the target."""

from __future__ import annotations

from collections.abc import Callable

import emcee
import numpy as np
import pytest
from emcee import moves
from numpy.typing import NDArray
from scipy.linalg import null_space

from identification.posterior.proposal import RidgeProposal, StudentProposal
from identification.posterior.ridge import Ridge

Array = NDArray[np.float64]

CENTRE = np.array([1.0, -2.0, 0.5])
NOISE = np.array([-3.0])
COVARIANCE = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, -0.3], [0.0, -0.3, 0.5]])
NOISE_SD = np.array([0.1])


def ridge() -> Ridge:
    """Ridge along the first coordinate, wider on one side and with a tail there."""
    tangent = COVARIANCE[:, 0] / np.sqrt(COVARIANCE[0, 0])
    functional = np.array([1.0, 0.0, 0.0])
    basis = null_space(functional[None, :])
    abscissa = np.arange(-4.0, 4.5, 0.5)
    across = np.linalg.cholesky(basis.T @ (COVARIANCE - np.outer(tangent, tangent)) @ basis)
    return Ridge(
        centre=CENTRE,
        tangent=tangent,
        functional=functional,
        abscissae=abscissa,
        shifts=np.zeros((abscissa.size, 3)),
        states=(),
        log_density=-0.5 * np.where(abscissa > 0, 0.7 * abscissa, abscissa) ** 2,
        roots=across * (1.0 + 0.1 * abscissa)[:, None, None],
        basis=basis,
    )


def normal(points: Array) -> Array:
    """Log density of the normal target."""
    away = points[:, :3] - CENTRE
    inner = np.einsum("wi,ij,wj->w", away, np.linalg.inv(COVARIANCE), away)
    noise = np.sum(((points[:, 3:] - NOISE) / NOISE_SD) ** 2, axis=1)
    return np.asarray(-0.5 * (inner + noise))


@pytest.mark.parametrize(
    "proposal",
    [
        lambda: RidgeProposal(ridge(), NOISE, NOISE_SD),
        lambda: StudentProposal(
            np.append(CENTRE, NOISE), 1.3 * np.diag([1.0, 1.0, 0.5, 0.01]), 5.0
        ),
    ],
    ids=["along the ridge", "around the optimum"],
)
def test_a_chain_of_proposals_samples_its_target(
    proposal: Callable[[], Callable[..., tuple[Array, Array]]],
) -> None:
    """Mean and covariance agree within four standard errors of the effective sample size."""
    start = np.append(CENTRE, NOISE) + 0.01 * np.random.default_rng(1).standard_normal((32, 4))
    sampler = emcee.EnsembleSampler(32, 4, normal, vectorize=True, moves=moves.MHMove(proposal()))
    state = emcee.State(start, random_state=np.random.RandomState(3).get_state())  # noqa: NPY002
    sampler.run_mcmc(state, 2000, skip_initial_state_check=True)
    chain = sampler.get_chain(discard=100)

    draws = chain.reshape(-1, 4)
    worth = draws.shape[0] / np.max(emcee.autocorr.integrated_time(chain, tol=0))
    scale = np.append(np.sqrt(np.diag(COVARIANCE)), NOISE_SD)
    expected = np.zeros((4, 4))
    expected[:3, :3] = COVARIANCE
    expected[3, 3] = NOISE_SD[0] ** 2
    error = 4.0 / np.sqrt(worth)
    np.testing.assert_allclose(
        (draws.mean(axis=0) - np.append(CENTRE, NOISE)) / scale, 0.0, atol=error
    )
    np.testing.assert_allclose(
        (np.cov(draws.T) - expected) / np.outer(scale, scale), 0.0, atol=1.5 * error
    )
    assert error < 0.05


def test_the_position_along_the_ridge_has_the_traced_density() -> None:
    """The share of draws on the side with the tail is that of the two half normals."""
    proposal = RidgeProposal(ridge(), NOISE, NOISE_SD)
    many = np.repeat(np.append(CENTRE, NOISE)[None, :], 40_000, axis=0)

    drawn, _ = proposal(many, np.random.RandomState(5))  # noqa: NPY002

    abscissa = drawn[:, 0] - CENTRE[0]
    assert np.mean(abscissa > 0) == pytest.approx((1 / 0.7) / (1 + 1 / 0.7), abs=0.01)
