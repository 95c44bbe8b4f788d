"""The short form of a torture test: batches that are killed finish, and fit nothing twice."""

from __future__ import annotations

from pathlib import Path

from benchmarks.torture import batches


def test_batch_that_is_killed_finishes_and_fits_nothing_twice(tmp_path: Path) -> None:
    """Few motors, two kills each of the command here, and of command and server: no fault."""
    outcomes = batches.run(short=True, directory=tmp_path)

    assert len(outcomes) == 2
    assert [outcome for outcome in outcomes if not outcome.passed] == []
