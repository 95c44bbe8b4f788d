"""Sampling of the posterior with emcee.

The ensemble starts from the normal approximation of the fit, and a good share of the proposals
comes from there too (independent draws from a multivariate t around the optimum): for the nearly
normal posteriors of long records they decorrelate in two steps where the stretch move takes fifty.
Differential evolution and stretch moves keep the sampler right where the posterior is bent or runs
into a bound.  How much is left to them depends on how well the normal approximation weighs the
walkers that start from it.

Source: Foreman-Mackey et al., PASP 125 (2013), 306 (emcee); ter Braak, Statistics and Computing 16
(2006), 239-249 (differential evolution); Tierney, Annals of Statistics 22 (1994), 1701-1728
(independence chains).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import emcee
import numpy as np
from emcee import moves
from numpy.typing import NDArray

from identification.posterior.checkpoint import Checkpoint
from identification.posterior.convergence import Convergence, convergence_of
from identification.posterior.density import Posterior
from identification.posterior.resume import chain_key, kept_backend, state_of

__all__ = ["Sample", "sample"]

Array = NDArray[np.float64]

_NARROW: Final = (200.0, 1.02)
_WIDE: Final = (5.0, 1.1)
"""Degrees of freedom of proposals, and their covariance over that of the normal approximation."""
_NORMAL: Final = 0.5
_CHUNK: Final = 10
_LEAST_STEPS: Final = 80
_LENGTHS: Final = 50.0


@dataclass(frozen=True)
class Sample:
    """Draws of the posterior.

    Args:
        chain: (n_step, n_walker, n_dim) physical values after burn-in.
        log_density: (n_step, n_walker).
        names: Names of the dimensions.
        units: Their units.
        convergence: How well the chain has mixed.
    """

    chain: Array
    log_density: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    convergence: Convergence

    def draws(self, most: int = 2000) -> dict[str, Array]:
        """At most `most` draws, evenly spread over the chain, by name."""
        flat = self.chain.reshape(-1, self.chain.shape[2])
        rows = np.unique(np.linspace(0, flat.shape[0] - 1, most).astype(int))
        return {name: flat[rows, k] for k, name in enumerate(self.names)}


def sample(
    posterior: Posterior,
    seed: int,
    most_steps: int = 3000,
    progress: Callable[[float], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> Sample:
    """Sample until the chain is 50 autocorrelation times long.

    Args:
        posterior: The density.
        seed: Seed; the same seed gives the same chain.
        most_steps: Steps after which to stop in any case; `Convergence.reached` says so.
        progress: Called with the fraction done.
        checkpoint: Where the chain is kept while it grows, and taken up again.
    """
    rng = np.random.default_rng(seed)
    covariance = posterior.covariance()
    n_dim = covariance.shape[0]
    walkers = max(32, 8 * -(-(2 * n_dim + 2) // 8))
    start = _start(posterior, covariance, walkers, rng)
    density = posterior(start)
    key = chain_key(posterior, covariance, seed, walkers)
    sampler = emcee.EnsembleSampler(
        walkers,
        n_dim,
        posterior,
        vectorize=True,
        moves=_moves(posterior.centre, covariance, start, density),
        backend=kept_backend(checkpoint, key, walkers, n_dim),
    )
    state = emcee.State(
        start,
        log_prob=density,
        random_state=np.random.RandomState(seed).get_state(),  # noqa: NPY002
    )
    done, tau = sampler.iteration, np.inf
    if done:
        state = sampler.get_last_sample()
    while done < most_steps:
        state = sampler.run_mcmc(state, _CHUNK, skip_initial_state_check=True)
        done += _CHUNK
        tau = float(np.max(emcee.autocorr.integrated_time(sampler.get_chain(), tol=0)))
        if progress is not None:
            goal = max(_LEAST_STEPS, 1.25 * _LENGTHS * tau) if np.isfinite(tau) else most_steps
            progress(min(1.0, done / min(goal, most_steps)))
        is_long = done >= _LEAST_STEPS and done - _burn_in(done, tau) >= _LENGTHS * tau
        if is_long and _convergence(sampler, _burn_in(done, tau)).reached:
            break
        if checkpoint is not None and checkpoint.is_due():
            checkpoint.save(key, state_of(sampler.backend))
    burn = _burn_in(done, tau)
    return Sample(
        chain=posterior.physical(sampler.get_chain(discard=burn)),
        log_density=sampler.get_log_prob(discard=burn),
        names=posterior.names,
        units=posterior.units,
        convergence=_convergence(sampler, burn),
    )


def _convergence(sampler: emcee.EnsembleSampler, burn: int) -> Convergence:
    """How well the chain has mixed after burn-in, by which it ends and which is reported."""
    accepted = float(np.mean(sampler.acceptance_fraction))
    return convergence_of(sampler.get_chain(discard=burn), accepted, _LENGTHS)


def _burn_in(done: int, tau: float) -> int:
    """Steps to leave out: three autocorrelation times, at least a tenth, at most half."""
    return int(np.clip(3 * tau, done // 10, done // 2)) if np.isfinite(tau) else done // 2


def _moves(
    centre: Array, covariance: Array, start: Array, density: Array
) -> list[tuple[object, float]]:
    narrow, wide = (
        moves.MHMove(_Independent(centre, inflation * covariance, freedom))
        for freedom, inflation in (_NARROW, _WIDE)
    )
    if _efficiency(centre, covariance, start, density) > _NORMAL:
        return [(narrow, 0.75), (wide, 0.1), (moves.DEMove(), 0.1), (moves.StretchMove(), 0.05)]
    return [(narrow, 0.1), (wide, 0.4), (moves.DEMove(), 0.3), (moves.StretchMove(), 0.2)]


def _efficiency(centre: Array, covariance: Array, start: Array, density: Array) -> float:
    """Share of draws from the normal approximation that count as draws of the posterior [-].

    Source: Kong, A note on importance sampling using standardized weights, University of Chicago
    Technical Report 348 (1992).
    """
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, (start - centre).T)
    weights = density + 0.5 * np.sum(scaled**2, axis=0)
    weights = np.exp(weights - weights.max())
    return float(weights.sum() ** 2 / np.sum(weights**2) / weights.size)


class _Independent:
    """Draws from a multivariate t around the optimum, whatever the walker's place."""

    def __init__(self, centre: Array, covariance: Array, freedom: float) -> None:
        self._centre = centre
        self._root = np.linalg.cholesky(covariance)
        self._freedom = freedom

    def __call__(self, coordinates: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        n_walker, n_dim = coordinates.shape
        normal = random.randn(n_walker, n_dim)
        size = np.sqrt(self._freedom / random.chisquare(self._freedom, size=n_walker))
        proposed = self._centre + (normal * size[:, None]) @ self._root.T
        return proposed, self._log_density(coordinates) - self._log_density(proposed)

    def _log_density(self, points: Array) -> Array:
        scaled = np.linalg.solve(self._root, (points - self._centre).T)
        distance = np.sum(scaled**2, axis=0)
        power = -0.5 * (self._freedom + points.shape[1])
        return np.asarray(power * np.log1p(distance / self._freedom))


def _start(
    posterior: Posterior, covariance: Array, walkers: int, rng: np.random.Generator
) -> Array:
    """Walkers drawn from the normal approximation, mirrored at the bounds."""
    root = np.linalg.cholesky(covariance)
    centre = posterior.centre
    points = centre + rng.standard_normal((walkers, centre.size)) @ root.T
    return posterior.mirrored(points)
