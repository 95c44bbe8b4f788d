"""Where an attempt keeps what it has so far, and what it takes of those before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.fits.job import FitJob
from app.fits.worker import checkpoint_of
from app.storage import CHECKPOINTS


def attempt(directory: Path, number: int) -> FitJob:
    """An attempt at a fit whose directories are below `directory`."""
    return FitJob("fit", number, str(directory / str(number)), (), (), {}, "a:b")


def kept(directory: Path, number: int) -> int | None:
    """What an attempt finds."""
    state = checkpoint_of(attempt(directory, number)).load("x")
    return None if state is None else int(state["n"])


def keep(directory: Path, number: int) -> None:
    """Have an attempt keep its own number."""
    checkpoint_of(attempt(directory, number)).save("x", {"n": np.array(number)})


def test_attempt_finds_what_the_last_one_before_it_kept(tmp_path: Path) -> None:
    """The tenth comes after the ninth; nobody sees what a later one kept."""
    for number in (1, 9, 10):
        keep(tmp_path, number)

    assert [kept(tmp_path, number) for number in (1, 2, 9, 10, 11)] == [1, 1, 9, 10, 10]


def test_attempt_that_was_given_up_overwrites_nothing(tmp_path: Path) -> None:
    """The first goes on writing after the second has begun."""
    keep(tmp_path, 1)
    keep(tmp_path, 2)

    keep(tmp_path, 1)

    assert kept(tmp_path, 3) == 2


def test_other_files_are_passed_over(tmp_path: Path) -> None:
    """The rest of one that was killed while it wrote."""
    keep(tmp_path, 1)
    (tmp_path / CHECKPOINTS / "2.part").write_bytes(b"half")
    (tmp_path / CHECKPOINTS / "x.npz").write_bytes(b"half")

    assert kept(tmp_path, 3) == 1


def test_nothing_is_made_before_something_is_kept(tmp_path: Path) -> None:
    """Most fits end before it is time."""
    checkpoint_of(attempt(tmp_path, 1))

    assert list(tmp_path.iterdir()) == []
