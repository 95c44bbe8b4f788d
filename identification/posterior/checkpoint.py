"""Checkpoint files of an MCMC chain, from which a later attempt resumes.

    checkpoint = Checkpoint(Path("checkpoints/2.npz"), earlier=(Path("checkpoints/1.npz"),))
    identify(training, validation, options, checkpoint=checkpoint)

Each attempt writes its own file and reads the files of earlier attempts.  An abandoned attempt that
is still running therefore overwrites nothing.  A file receives its name only when its content is on
the disk, so it is either complete or absent.  A file is used only if its key is that of the chain.
If no file matches or can be read, the chain starts over, which costs only time.

Every process that computes a fit imports this module, so it imports little.  The content of a
chain's state is defined in `identification.posterior.sample`.
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

import numpy as np
from numpy.typing import NDArray

__all__ = ["Checkpoint", "digest"]

_INTERVAL_S: Final = 10.0


class Checkpoint:
    """State files of this attempt and of earlier attempts.

    Args:
        path: File of this attempt; its directory is created on demand.
        earlier: Files of earlier attempts, the best first.
        interval_s: Shortest time between two saves [s].
        subject: Hash of the job; a state of another job is not used.
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
        """Copy with the same files, bound to one job: the hashes of its runs and its options."""
        words = digest(subject)
        return type(self)(self._path, self._earlier, self._interval_s, words)

    def load(self, key: str) -> dict[str, NDArray[Any]] | None:
        """Load the state saved under a key, this attempt's file first; None if there is none."""
        for path in (self._path, *self._earlier):
            state = _read(path)
            if state is not None and str(state.pop("key", "")) == self._subject + key:
                return state
        return None

    def is_due(self) -> bool:
        """True if the shortest time between two saves has passed."""
        return time.monotonic() - self._saved >= self._interval_s

    def save(self, key: str, state: Mapping[str, NDArray[Any]]) -> None:
        """Replace the saved state; if writing fails, the chain continues without it."""
        neighbour = self._path.with_suffix(".part")
        try:
            self._path.parent.mkdir(exist_ok=True)
            with neighbour.open("wb") as file:
                np.savez(file, allow_pickle=False, key=np.array(self._subject + key), **state)
                file.flush()
                os.fsync(file.fileno())
            neighbour.replace(self._path)
        except OSError:
            # The disk is full or the fit was deleted.  The chain itself is unaffected.
            with suppress(OSError):
                neighbour.unlink()
        self._saved = time.monotonic()


def digest(*words: object) -> str:
    """SHA-256 hash of numbers and texts."""
    return hashlib.sha256(repr(words).encode()).hexdigest()


def _read(path: Path) -> dict[str, NDArray[Any]] | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None
