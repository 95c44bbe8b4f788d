"""What a long chain has so far, kept in a file, so that a later attempt goes on from there.

    checkpoint = Checkpoint(Path("checkpoints/2.npz"), earlier=(Path("checkpoints/1.npz"),))
    identify(training, validation, options, checkpoint=checkpoint)

An attempt writes to a file of its own and reads those of the attempts before it, so that one which
was given up and still runs overwrites nothing.  A file is complete or not there: it takes its name
when its content is on the disk.  It is used where its key is that of the chain, and otherwise the
chain starts over; so does it where the file cannot be read, since all that is lost is time.

Whatever computes a fit loads this file, so it imports little; what the state of a chain is stands
in `identification.posterior.resume`.
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
        words = digest(subject)
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


def digest(*words: object) -> str:
    """A hash of numbers and texts."""
    return hashlib.sha256(repr(words).encode()).hexdigest()


def _read(path: Path) -> dict[str, NDArray[Any]] | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None
