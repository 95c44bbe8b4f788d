"""What a long chain has so far, kept in a file, so that a later attempt goes on from there.

    checkpoint = Checkpoint(Path("checkpoints/2.npz"), earlier=(Path("checkpoints/1.npz"),))
    identify(training, validation, options, checkpoint=checkpoint)

An attempt writes to a file of its own and reads those of the attempts before it, so that one which
was given up and still runs overwrites nothing.  A file is complete or not there: it takes its name
when its content is on the disk.  It is used where its key is that of the chain, and otherwise the
chain starts over; so does it where the file cannot be read, since all that is lost is time.

Kept are the walkers' ways, their densities and the state of the random numbers: a chain that goes
on is number for number the one that was not interrupted.
"""

from __future__ import annotations

import hashlib
import os
import time
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Self

import emcee
import numpy as np
from numpy.typing import NDArray

from identification.posterior.density import Posterior

__all__ = ["Checkpoint", "chain_key", "kept_backend", "state_of"]

Array = NDArray[np.float64]

_INTERVAL_S: Final = 10.0
_RESOLUTION: Final = 0.01


class Checkpoint:
    """Where an attempt keeps its state, and where those before it kept theirs.

    Args:
        path: File of this attempt; the directory above it is made when it is needed.
        earlier: Files of the attempts before it, the best first.
        interval_s: Least time between two savings [s].
        subject: What the work is about; a state of other work is not used.
    """

    def __init__(
        self,
        path: Path,
        earlier: Sequence[Path] = (),
        interval_s: float = _INTERVAL_S,
        subject: str = "",
    ) -> None:
        self._path = path
        self._earlier = tuple(earlier)
        self._interval_s = interval_s
        self._subject = subject
        self._saved = time.monotonic()

    def about(self, *subject: object) -> Self:
        """The same files for one piece of work, such as the hashes of its runs and its options."""
        words = _digest(repr(subject).encode())
        return type(self)(self._path, self._earlier, self._interval_s, words)

    def load(self, key: str) -> dict[str, NDArray[Any]] | None:
        """The state that was saved last under a key, or None.

        Args:
            key: What it is the state of.
        """
        for path in (self._path, *self._earlier):
            state = _read(path)
            if state is not None and str(state.pop("key", "")) == self._subject + key:
                return state
        return None

    def is_due(self) -> bool:
        """Whether it is time to save again."""
        return time.monotonic() - self._saved >= self._interval_s

    def save(self, key: str, state: Mapping[str, NDArray[Any]]) -> None:
        """Replace what was saved before; where that cannot be done the work goes on without.

        Args:
            key: What it is the state of.
            state: Arrays by name.
        """
        neighbour = self._path.with_suffix(".part")
        try:
            self._path.parent.mkdir(exist_ok=True)
            with neighbour.open("wb") as file:
                np.savez(file, allow_pickle=False, key=np.array(self._subject + key), **state)
                file.flush()
                os.fsync(file.fileno())
            neighbour.replace(self._path)
        except OSError:
            # No space, or the fit was removed.  The chain itself is not hurt.
            with suppress(OSError):
                neighbour.unlink()
        self._saved = time.monotonic()


def chain_key(posterior: Posterior, covariance: Array, seed: int, walkers: int) -> str:
    """Key of a chain: what is sampled, where it is, how wide it is, and from which seed.

    Centre and widths are rounded to a hundredth of a standard deviation, so that another machine,
    whose last digits differ, can go on where this one stopped.

    Args:
        posterior: The density.
        covariance: (n_dim, n_dim) of its normal approximation.
        seed: Seed of the chain.
        walkers: Number of walkers.
    """
    spread = np.sqrt(np.diag(covariance))
    place = np.rint(posterior.centre / spread / _RESOLUTION)
    width = np.rint(np.log(spread) / _RESOLUTION)
    words = (posterior.names, seed, walkers, place.tolist(), width.tolist())
    return _digest(repr(words).encode())


def state_of(backend: emcee.backends.Backend) -> dict[str, NDArray[Any]]:
    """The state of a chain as arrays.

    Args:
        backend: What emcee keeps of it.
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


def kept_backend(
    checkpoint: Checkpoint | None, key: str, walkers: int, n_dim: int
) -> emcee.backends.Backend:
    """What emcee begins with: the state that was saved, or nothing.

    Args:
        checkpoint: Where it may have been saved.
        key: Key of the chain.
        walkers: Number of walkers.
        n_dim: Number of dimensions.
    """
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


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(path: Path) -> dict[str, NDArray[Any]] | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None
