"""Proposal of training and validation runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from app.runs.roles import proposed_roles


@dataclass
class Recorded:
    """Run with a file name and the range of its temperature and speed."""

    file: str
    temperature: tuple[float, float] = (20.0, 30.0)
    speed: tuple[float, float] = (-100.0, 100.0)
    channels: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        ranges = {"temperature_degC": self.temperature, "speed_rad_s": self.speed}
        self.channels = {name: {"min": a, "max": b} for name, (a, b) in ranges.items()}

    @property
    def id(self) -> str:
        """The file name identifies the run."""
        return self.file


def validating(*runs: Recorded) -> set[str]:
    """Files that the proposal sets apart."""
    return {name for name, role in proposed_roles(runs).items() if role == "validation"}


@pytest.mark.parametrize(
    "file", ["validation_1.csv", "motor-val.csv", "VAL2.mf4", "test_run.csv", "holdout.csv"]
)
def test_file_that_is_named_for_validation_validates(file: str) -> None:
    """The user has decided before; all other runs train."""
    runs = [Recorded("cold.csv"), Recorded(file), Recorded("hot.csv", (80.0, 90.0))]

    assert validating(*runs) == {file}


@pytest.mark.parametrize("file", ["interval.csv", "value.csv", "latest.csv", "valve.csv"])
def test_word_that_contains_another_is_no_name(file: str) -> None:
    """Only the latest of three equal runs is set apart, as without a name."""
    assert validating(Recorded(file), Recorded("b.csv"), Recorded("c.csv")) == {"c.csv"}


def test_extreme_runs_train() -> None:
    """Cold, hot and fast runs widen the ranges; the run between them validates."""
    runs = [
        Recorded("cold.csv", (5.0, 20.0)),
        Recorded("between.csv", (40.0, 50.0), (-90.0, 90.0)),
        Recorded("fast.csv", (40.0, 50.0), (-400.0, 400.0)),
        Recorded("hot.csv", (90.0, 110.0)),
    ]

    assert validating(*runs) == {"between.csv"}


def test_two_runs_both_train() -> None:
    """A fit of half of the information is worse than a model without validation."""
    assert validating(Recorded("a.csv"), Recorded("b.csv")) == set()


def test_all_named_for_validation_is_no_decision() -> None:
    """A fit needs a training run."""
    runs = [Recorded(f"test_{n}.csv") for n in range(3)]

    assert validating(*runs) == {"test_2.csv"}
