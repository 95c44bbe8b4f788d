"""Chains resumed from checkpoints, and checkpoint files of other work."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from identification.fit.declared import fit_declared
from identification.model.excitation import records_of
from identification.posterior.checkpoint import Checkpoint
from identification.posterior.density import Posterior
from identification.posterior.sample import Sample, sample
from tests.motors import campaign, motor_named

SEED = 3


class Interrupted(Exception):
    """End of the process as the sampler sees it."""


@functools.cache
def posterior(data: int = 1) -> Posterior:
    """Posterior of a short record of the servo motor."""
    runs = campaign(motor_named("servo 100 W"), seed=data, noise=0.01, rows=400)
    return Posterior(fit_declared(records_of(runs), "zoh"), 1.0)


@functools.cache
def uninterrupted() -> Sample:
    """Chain sampled without interruption."""
    return sample(posterior(), SEED)


@functools.cache
def chunks() -> int:
    """Number of progress reports of that chain."""
    told: list[float] = []
    sample(posterior(), SEED, progress=told.append)
    return len(told)


def interrupt(checkpoint: Checkpoint, calls: int = 4) -> None:
    """Sample up to the given number of progress reports, then stop as a kill would."""
    told: list[float] = []

    def progress(fraction: float) -> None:
        told.append(fraction)
        if len(told) == calls:
            raise Interrupted

    with pytest.raises(Interrupted, match="^$"):
        sample(posterior(), SEED, progress=progress, checkpoint=checkpoint)


def steps_of(checkpoint: Checkpoint, data: int = 1, seed: int = SEED) -> int:
    """Number of progress reports of a sampling that may start from a checkpoint."""
    told: list[float] = []
    sample(posterior(data), seed, progress=told.append, checkpoint=checkpoint)
    return len(told)


def test_resumed_chain_equals_the_uninterrupted_one(tmp_path: Path) -> None:
    """A chain interrupted in two attempts equals the uninterrupted chain number by number."""
    first, second, third = (tmp_path / "kept" / f"{n}.npz" for n in (1, 2, 3))
    interrupt(Checkpoint(first, interval_s=0.0))
    interrupt(Checkpoint(second, [first], interval_s=0.0), calls=2)
    told: list[float] = []

    resumed = sample(
        posterior(), SEED, progress=told.append, checkpoint=Checkpoint(third, [second, first])
    )

    np.testing.assert_array_equal(resumed.chain, uninterrupted().chain)
    np.testing.assert_array_equal(resumed.log_density, uninterrupted().log_density)
    assert resumed.convergence == uninterrupted().convergence
    # The first attempt saved three chunks, the second one more.
    assert len(told) == chunks() - 4


def test_attempts_have_files_of_their_own(tmp_path: Path) -> None:
    """A slow first attempt that still runs does not overwrite the file of the second."""
    first, second = (tmp_path / f"{n}.npz" for n in (1, 2))
    interrupt(Checkpoint(first, interval_s=0.0), calls=2)
    interrupt(Checkpoint(second, [first], interval_s=0.0), calls=4)
    kept = second.read_bytes()

    interrupt(Checkpoint(first, interval_s=0.0), calls=2)

    assert second.read_bytes() == kept
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.npz", "2.npz"]


def test_state_of_other_work_is_not_used(tmp_path: Path) -> None:
    """Other options, runs, data or seeds start a new chain; equal ones resume it."""
    path = tmp_path / "1.npz"
    about = Checkpoint(path, interval_s=0.0).about(["run"], "options")
    interrupt(about)
    kept = path.read_bytes()

    def later(*subject: object) -> Checkpoint:
        path.write_bytes(kept)
        return Checkpoint(tmp_path / "2.npz", [path], interval_s=1e9).about(*subject)

    assert steps_of(later(["run"], "options")) == chunks() - 3
    assert steps_of(later(["run"], "other")) == chunks()
    assert steps_of(later(["run"], "options"), seed=SEED + 1) >= 8
    assert steps_of(later(["run"], "options"), data=2) >= 8


@pytest.mark.parametrize(
    "spoil",
    [lambda kept: kept[: len(kept) // 2], lambda kept: b"", lambda kept: b"\x93NUMPY" + kept],
    ids=["half", "empty", "other"],
)
def test_broken_file_costs_time_only(tmp_path: Path, spoil: Callable[[bytes], bytes]) -> None:
    """After a power failure with a damaged file, the previous file is used."""
    first, second = (tmp_path / f"{n}.npz" for n in (1, 2))
    interrupt(Checkpoint(first, interval_s=0.0))
    second.write_bytes(spoil(first.read_bytes()))

    resumed = sample(posterior(), SEED, checkpoint=Checkpoint(tmp_path / "3.npz", [second, first]))

    np.testing.assert_array_equal(resumed.chain, uninterrupted().chain)


def test_chain_continues_if_no_checkpoint_can_be_written(tmp_path: Path) -> None:
    """The parent directory is a file, which fails like a full disk."""
    (tmp_path / "kept").touch()

    made = sample(
        posterior(), SEED, checkpoint=Checkpoint(tmp_path / "kept" / "1.npz", interval_s=0.0)
    )

    np.testing.assert_array_equal(made.chain, uninterrupted().chain)
