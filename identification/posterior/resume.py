"""State of an emcee chain as arrays, and a backend that resumes from it.

The state holds the positions of the walkers, their log densities and the state of the random
generator.  A resumed chain equals an uninterrupted one, number for number.
"""

from __future__ import annotations

from typing import Any, Final

import emcee
import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.posterior.checkpoint import Checkpoint, digest
from identification.posterior.density import Posterior

__all__ = ["chain_key", "kept_backend", "state_of"]

_RESOLUTION: Final = 0.01


def chain_key(posterior: Posterior, covariance: Array, seed: int, walkers: int) -> str:
    """Key of a chain: its dimensions, centre, widths, seed and number of walkers.

    The covariance (n_dim, n_dim) is that of the normal approximation.

    Centre and widths are rounded to a hundredth of a standard deviation.  Another machine, whose
    last digits differ, can therefore resume the chain.
    """
    spread = np.sqrt(np.diag(covariance))
    place = np.rint(posterior.centre / spread / _RESOLUTION)
    width = np.rint(np.log(spread) / _RESOLUTION)
    return digest(posterior.names, seed, walkers, place.tolist(), width.tolist())


def state_of(backend: emcee.backends.Backend) -> dict[str, NDArray[Any]]:
    """State of a chain in a backend of emcee as arrays."""
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


def kept_backend(
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
