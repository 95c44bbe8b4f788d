"""Ensemble MCMC of the posterior with emcee; weighted draws if the chain does not converge.

The ensemble starts from the normal approximation of the fit.  Most proposals are independent draws
from a multivariate t around the optimum.  For the nearly normal posteriors of long records they
decorrelate in two steps, the stretch move in fifty.  If the posterior is curved, truncated or
long-tailed, most proposals are draws along its traced ridge.  Differential-evolution and stretch
moves keep the chain moving if neither proposal fits the posterior.

Source: Foreman-Mackey et al., PASP 125 (2013), 306 (emcee); ter Braak, Statistics and Computing 16
(2006), 239-249 (differential evolution).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import emcee
import numpy as np
from emcee import moves
from numpy.typing import NDArray

from identification.arrays import Array
from identification.posterior.checkpoint import Checkpoint, digest
from identification.posterior.convergence import (
    REQUIRED_LENGTH,
    Convergence,
    autocorrelation_times,
    convergence_of,
)
from identification.posterior.density import Posterior
from identification.posterior.importance import weighted_draws
from identification.posterior.proposal import RidgeProposal, StudentProposal
from identification.work import was_interrupted

__all__ = ["Sample", "Source", "sample"]

Source = Literal["chain", "importance", "normal"]

_NARROW: Final = (200.0, 1.02)
_WIDE: Final = (5.0, 1.1)
"""Degrees of freedom of narrow and wide proposals, and their covariance over that of the normal
approximation."""
_CHUNK: Final = 10
_LEAST_STEPS: Final = 80
_GLIMPSE: Final = 20
"""Steps of a chain whose budget is too small for convergence."""
_REPLACED: Final = 2000
"""Number of draws that replace an unconverged chain."""
_TRIAL: Final = 300
"""Steps after which a chain is abandoned if the step limit is too low for its convergence."""
_RESOLUTION: Final = 0.01
_FIRST_TRIAL: Final = 40
"""Steps after which the autocorrelation time can abandon a chain at the earliest, and a quarter of
its step limit."""
_HELD: Final = 20
"""Steps after which the acceptance can: of some thousand proposals it is known to a few
hundredths."""
_HOPELESS: Final = 4.0
"""Length that a chain needs, over its step limit, at which it is abandoned before `_TRIAL` steps.
Walkers that still approach the posterior lengthen the autocorrelation time; a factor of four leaves
room for them."""


@dataclass(frozen=True)
class Sample:
    """Draws from the posterior."""

    chain: Array
    """(n_step, n_walker, n_dim) physical values after burn-in."""
    log_density: Array | None
    """(n_step, n_walker); None for normal draws, whose posterior density is not evaluated."""
    names: tuple[str, ...]
    units: tuple[str, ...]
    convergence: Convergence
    source: Source = "chain"
    """Origin of the draws: the ``chain``; if it did not converge, ``importance`` sampling; if that
    is not reliable either, the ``normal`` approximation."""
    shape: float | None = None
    """Pareto shape of the importance weights [-]; None if there are none."""

    def draws(self, most: int = 2000) -> dict[str, Array]:
        """At most `most` draws by name, evenly spread over the chain."""
        flat = self.chain.reshape(-1, self.chain.shape[2])
        rows = np.unique(np.linspace(0, flat.shape[0] - 1, most).astype(int))
        return {name: flat[rows, k] for k, name in enumerate(self.names)}


def sample(
    posterior: Posterior,
    seed: int,
    most_steps: int = 3000,
    work: float = np.inf,
    progress: Callable[[float], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> Sample:
    """Sample until the chain is 50 autocorrelation times long.

    The chain also stops after `most_steps` or, in whole chunks of steps, after the operations
    `work`; a checkpoint saves it while it grows, and resumes it.
    """
    covariance = posterior.covariance()
    n_dim = covariance.shape[0]
    walkers = max(32, 8 * -(-2 * n_dim // 8))
    start = posterior.normal_points(seed, walkers)
    density = posterior(start)
    key = _chain_key(posterior, covariance, seed, walkers)
    moves, backend = _moves(posterior, covariance), _kept_backend(checkpoint, key, walkers, n_dim)
    sampler = emcee.EnsembleSampler(
        walkers, n_dim, posterior, vectorize=True, moves=moves, backend=backend
    )
    random_state = np.random.RandomState(seed).get_state()  # noqa: NPY002
    state = emcee.State(start, log_prob=density, random_state=random_state)
    done, tau = sampler.iteration, np.inf
    affordable = work / posterior.work(walkers)
    # No chain of fewer steps converges; they serve for its diagnostics alone.
    affordable = affordable if affordable >= _LEAST_STEPS else _GLIMPSE
    limit = min(most_steps, affordable)
    if done:
        state = sampler.get_last_sample()
    while done < limit:
        state = sampler.run_mcmc(state, _CHUNK, skip_initial_state_check=True)
        done += _CHUNK
        tau = float(np.max(autocorrelation_times(sampler.get_chain())))
        if progress is not None:
            goal = (
                max(_LEAST_STEPS, 1.25 * REQUIRED_LENGTH * tau) if np.isfinite(tau) else most_steps
            )
            progress(min(1.0, done / min(goal, limit)))
        proposals, accepted = done * walkers, float(np.mean(sampler.acceptance_fraction))
        is_held = done >= _HELD and _is_held(proposals, accepted, limit)
        if is_held or _is_hopeless(done, tau, limit):
            break
        is_long = done >= _LEAST_STEPS and done - _burn_in(done, tau) >= REQUIRED_LENGTH * tau
        if is_long and _convergence(sampler, _burn_in(done, tau)).reached:
            break
        if was_interrupted():
            break
        if checkpoint is not None and checkpoint.is_due():
            checkpoint.save(key, _state_of(sampler.backend))
    found = _sample_of(sampler, posterior, _burn_in(done, tau))
    if found.convergence.reached or was_interrupted():
        return found
    return _replaced(found, posterior, seed, work)


def _is_hopeless(done: int, tau: float, limit: float) -> bool:
    """True if a chain cannot become long enough within its step limit.

    A chain with a low limit is abandoned earlier, if it would have to be several times as long.
    """
    needed = 1.25 * REQUIRED_LENGTH * tau
    if done >= _TRIAL:
        return not needed < limit
    return done >= max(_FIRST_TRIAL, limit / 4) and not needed < _HOPELESS * limit


def _is_held(proposals: int, accepted: float, limit: float) -> bool:
    """True if the walkers stay in place for too long, by the fraction of accepted proposals [-].

    A walker stays for 1 / a steps on average, so that the autocorrelation time is 2 / a - 1 even if
    accepted proposals are independent.  The fraction a is taken three standard errors higher.
    """
    upper = accepted + 3.0 * np.sqrt(accepted * (1.0 - accepted) / proposals) + 3.0 / proposals
    return bool(1.25 * REQUIRED_LENGTH * (2.0 / upper - 1.0) > _HOPELESS * limit)


def _sample_of(sampler: emcee.EnsembleSampler, posterior: Posterior, burn: int) -> Sample:
    """The chain without its first steps."""
    return Sample(
        chain=posterior.physical(sampler.get_chain(discard=burn)),
        log_density=sampler.get_log_prob(discard=burn),
        names=posterior.names,
        units=posterior.units,
        convergence=_convergence(sampler, burn),
    )


def _replaced(found: Sample, posterior: Posterior, seed: int, work: float) -> Sample:
    """Replace the draws of an unconverged chain by importance or normal draws."""
    walkers = found.convergence.walkers
    count = walkers * max(_REPLACED // walkers, 1)
    weighted = weighted_draws(posterior, seed, count, work)
    is_reliable = weighted.is_reliable
    points = weighted.points if is_reliable else posterior.normal_points(seed, count)
    return replace(
        found,
        chain=posterior.physical(points).reshape(-1, walkers, points.shape[1]),
        log_density=weighted.log_density.reshape(-1, walkers) if is_reliable else None,
        source="importance" if is_reliable else "normal",
        shape=weighted.shape,
    )


def _convergence(sampler: emcee.EnsembleSampler, burn: int) -> Convergence:
    """Convergence diagnostics after burn-in, for the stopping rule and for the report."""
    accepted = float(np.mean(sampler.acceptance_fraction))
    return convergence_of(sampler.get_chain(discard=burn), accepted)


def _burn_in(done: int, tau: float) -> int:
    """Burn-in [steps]: three autocorrelation times, at least a tenth, at most half of the chain."""
    return int(np.clip(3 * tau, done // 10, done // 2)) if np.isfinite(tau) else done // 2


def _moves(posterior: Posterior, covariance: Array) -> list[tuple[object, float]]:
    centre, ridge = posterior.centre, posterior.ridge
    narrow, wide = (
        moves.MHMove(StudentProposal(centre, inflation * covariance, freedom))
        for freedom, inflation in (_NARROW, _WIDE)
    )
    others = [(wide, 0.1), (moves.DEMove(), 0.1), (moves.StretchMove(), 0.05)]
    if ridge.is_straight:
        return [(narrow, 0.85), (wide, 0.07), (moves.DEMove(), 0.05), (moves.StretchMove(), 0.03)]
    n = ridge.centre.size
    noise_sd = np.sqrt(np.diag(covariance)[n:])
    on_ridge = moves.MHMove(RidgeProposal(ridge, centre[n:], noise_sd))
    return [(on_ridge, 0.6), (narrow, 0.15), *others]


def _chain_key(posterior: Posterior, covariance: Array, seed: int, walkers: int) -> str:
    """Key of a chain: its dimensions, centre, widths, seed and number of walkers.

    The covariance (n_dim, n_dim) is that of the normal approximation.

    Centre and widths are rounded to a hundredth of a standard deviation.  Another machine, whose
    last digits differ, can therefore resume the chain.
    """
    spread = np.sqrt(np.diag(covariance))
    place = np.rint(posterior.centre / spread / _RESOLUTION)
    width = np.rint(np.log(spread) / _RESOLUTION)
    return digest(posterior.names, seed, walkers, place.tolist(), width.tolist())


def _state_of(backend: emcee.backends.Backend) -> dict[str, NDArray[Any]]:
    """State of a chain in a backend of emcee as arrays.

    It holds the positions of the walkers, their log densities and the state of the random
    generator.  A resumed chain equals an uninterrupted one, number for number.
    """
    _, keys, position, has_gauss, gauss = backend.random_state
    steps = backend.iteration
    return {
        "chain": backend.chain[:steps],
        "log_prob": backend.log_prob[:steps],
        "accepted": backend.accepted,
        "random_keys": keys,
        "random_place": np.array([position, has_gauss], dtype=np.float64),
        "random_gauss": np.array(gauss),
    }


def _kept_backend(
    checkpoint: Checkpoint | None, key: str, walkers: int, n_dim: int
) -> emcee.backends.Backend:
    """Backend of emcee with the state saved under a key; empty if none was saved."""
    backend = emcee.backends.Backend()
    state = None if checkpoint is None else checkpoint.load(key)
    if state is None or state["chain"].shape[1:] != (walkers, n_dim):
        return backend
    backend.reset(walkers, n_dim)
    backend.chain, backend.log_prob = state["chain"], state["log_prob"]
    backend.accepted = state["accepted"]
    backend.iteration = len(backend.chain)
    position, has_gauss = (int(number) for number in state["random_place"])
    gauss = float(state["random_gauss"])
    backend.random_state = ("MT19937", state["random_keys"], position, has_gauss, gauss)
    return backend
