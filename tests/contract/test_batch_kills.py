"""Short torture test of batches: a killed batch finishes and fits no motor twice."""

from __future__ import annotations

from pathlib import Path

from benchmarks.torture import batches


def test_killed_batch_finishes_and_fits_nothing_twice(tmp_path: Path) -> None:
    """The command is killed twice in a local batch, command and server in a remote one."""
    outcomes = batches.run(short=True, directory=tmp_path)

    assert len(outcomes) == 2
    assert [outcome for outcome in outcomes if not outcome.passed] == []
