"""Checkpoints of an attempt and of earlier attempts at the same fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.fits.job import FitJob
from app.fits.worker import checkpoint_of
from app.storage import CHECKPOINTS


def attempt(directory: Path, number: int) -> FitJob:
    """Attempt with its directory below `directory`."""
    return FitJob("fit", number, str(directory / str(number)), (), (), {}, "a:b")


def kept(directory: Path, number: int) -> int | None:
    """Number stored in the checkpoint that an attempt finds, or None."""
    state = checkpoint_of(attempt(directory, number)).load("x")
    return None if state is None else int(state["n"])


def keep(directory: Path, number: int) -> None:
    """Store the number of an attempt in its checkpoint."""
    checkpoint_of(attempt(directory, number)).save("x", {"n": np.array(number)})


def test_attempt_finds_the_newest_earlier_checkpoint(tmp_path: Path) -> None:
    """Attempts are ordered by number, not as text, and later checkpoints are ignored."""
    for number in (1, 9, 10):
        keep(tmp_path, number)

    assert [kept(tmp_path, number) for number in (1, 2, 9, 10, 11)] == [1, 1, 9, 10, 10]


def test_abandoned_attempt_overwrites_no_checkpoint(tmp_path: Path) -> None:
    """The first attempt still writes after the second has started."""
    keep(tmp_path, 1)
    keep(tmp_path, 2)

    keep(tmp_path, 1)

    assert kept(tmp_path, 3) == 2


def test_other_files_are_ignored(tmp_path: Path) -> None:
    """A killed attempt may leave a partial file."""
    keep(tmp_path, 1)
    (tmp_path / CHECKPOINTS / "2.part").write_bytes(b"half")
    (tmp_path / CHECKPOINTS / "x.npz").write_bytes(b"half")

    assert kept(tmp_path, 3) == 1


def test_no_directory_exists_before_the_first_checkpoint(tmp_path: Path) -> None:
    """Most fits end before their first checkpoint."""
    checkpoint_of(attempt(tmp_path, 1))

    assert list(tmp_path.iterdir()) == []
