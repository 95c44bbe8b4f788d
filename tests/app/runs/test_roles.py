"""Proposal of training and validation runs."""

from __future__ import annotations

import pytest

from app.runs.choice import proposed_roles
from app.tables import RunRow


def recorded(
    file: str,
    temperature: tuple[float, float] = (20.0, 30.0),
    speed: tuple[float, float] = (-100.0, 100.0),
    sha256: str = "",
) -> RunRow:
    """Run with a file name, which identifies it, and the range of its temperature and speed."""
    ranges = {"temperature_degC": temperature, "speed_rad_s": speed}
    channels = {name: {"min": low, "max": high} for name, (low, high) in ranges.items()}
    return RunRow(id=file, file=file, channels=channels, sha256=sha256 or file)


def validating(*runs: RunRow) -> set[str]:
    """Files that the proposal sets apart."""
    return {name for name, role in proposed_roles(runs).items() if role == "validation"}


@pytest.mark.parametrize(
    "file", ["validation_1.csv", "motor-val.csv", "VAL2.mf4", "test_run.csv", "holdout.csv"]
)
def test_file_that_is_named_for_validation_validates(file: str) -> None:
    """The user has decided before; all other runs train."""
    runs = [recorded("cold.csv"), recorded(file), recorded("hot.csv", (80.0, 90.0))]

    assert validating(*runs) == {file}


@pytest.mark.parametrize("file", ["interval.csv", "value.csv", "latest.csv", "valve.csv"])
def test_word_that_contains_another_is_no_name(file: str) -> None:
    """Only the latest of three equal runs is set apart, as without a name."""
    assert validating(recorded(file), recorded("b.csv"), recorded("c.csv")) == {"c.csv"}


def test_extreme_runs_train() -> None:
    """Cold, hot and fast runs widen the ranges; the run between them validates."""
    runs = [
        recorded("cold.csv", (5.0, 20.0)),
        recorded("between.csv", (40.0, 50.0), (-90.0, 90.0)),
        recorded("fast.csv", (40.0, 50.0), (-400.0, 400.0)),
        recorded("hot.csv", (90.0, 110.0)),
    ]

    assert validating(*runs) == {"between.csv"}


def test_two_runs_both_train() -> None:
    """A fit of half of the information is worse than a model without validation."""
    assert validating(recorded("a.csv"), recorded("b.csv")) == set()


def test_all_named_for_validation_is_no_decision() -> None:
    """A fit needs a training run."""
    runs = [recorded(f"test_{n}.csv") for n in range(3)]

    assert validating(*runs) == {"test_2.csv"}


def test_run_that_was_corrected_has_no_role() -> None:
    """The same file with a later mapping takes its place, so no file both trains and validates."""
    wrong, right = recorded("wrong", sha256="one file"), recorded("right", sha256="one file")

    roles = proposed_roles([wrong, recorded("b.csv"), recorded("c.csv"), right])

    assert roles == {
        "wrong": "",
        "b.csv": "training",
        "c.csv": "training",
        "right": "validation",
    }
