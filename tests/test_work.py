"""Budgets of operations: the result does not depend on clock, load or threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bench import make_campaign
from identification.errors import OptionError
from identification.options import EFFORTS, FitOptions
from identification.work import Budget, charge, charge_once, metered, operations, was_interrupted

PROGRAM = """
import sys
from pathlib import Path
from identification import FitOptions, identify, read_run
from identification.threads import use_threads

use_threads(int(sys.argv[1]))
found = identify([read_run(sys.argv[2])], options=FitOptions(effort="quick"))
found.write(Path(sys.argv[3]))
"""


def test_budget_is_spent_by_operations_alone() -> None:
    """Ten operations are allowed, and eleven are charged."""
    with metered():
        budget = Budget(10.0)
        charge(10.0)
        assert not budget.spent
        charge(1.0)
        assert budget.spent


def test_inner_budget_is_limited_by_the_outer() -> None:
    """The larger inner budget is cut to the remainder of the outer one."""
    with metered():
        outer = Budget(5.0)
        assert Budget(100.0, within=outer).left == 5.0


def test_compiled_structure_is_charged_once_in_each_identification() -> None:
    """Code compiled by an earlier identification does not change the count."""
    for _ in range(2):
        with metered():
            charge_once("structure", 7.0)
            charge_once("structure", 7.0)
            assert operations() == 7.0


def test_time_limit_spends_every_budget_and_is_remembered() -> None:
    """Once the time limit has passed, it is not checked again."""
    answers = iter([False, True, False])
    with metered(lambda: next(answers)):
        budget = Budget()
        assert not budget.spent
        assert budget.spent
        assert was_interrupted()


def test_efforts_grow_from_quick_to_thorough() -> None:
    """Each level allows more operations of every stage than the one before."""
    quick, normal, thorough = (EFFORTS[name] for name in ("quick", "normal", "thorough"))
    for less, more in ((quick, normal), (normal, thorough)):
        assert less.search_of(10_000) < more.search_of(10_000)
        assert less.sampling < more.sampling
        assert less.steps < more.steps


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("inf"), float("nan")])
def test_time_limit_is_a_positive_number_of_seconds(seconds: float) -> None:
    """The message gives the option for no limit."""
    with pytest.raises(OptionError, match=r"time_limit is .* \(omit the option for no limit\)"):
        FitOptions(time_limit=seconds)


def test_unknown_effort_is_refused_with_the_levels() -> None:
    """The message lists the three levels."""
    with pytest.raises(OptionError, match="'much'; expected quick, normal or thorough"):
        FitOptions(effort="much")  # type: ignore[arg-type]


def test_result_is_the_same_bytes_with_one_two_and_sixteen_threads(tmp_path: Path) -> None:
    """A motor with Coulomb friction exercises search, sampler and linear algebra."""
    make_campaign(
        "servo_150w", ["coulomb_friction"], seed=5, rows=370, training=1, validation=0
    ).write(tmp_path)
    written = []
    for number in (1, 2, 16):
        out = tmp_path / str(number)
        words = [
            sys.executable,
            "-c",
            PROGRAM,
            str(number),
            str(tmp_path / "training_1.csv"),
            str(out),
        ]
        subprocess.run(words, check=True, env=os.environ | {"OPENBLAS_NUM_THREADS": str(number)})
        written.append((out / "result.json").read_text(encoding="utf-8"))

    assert written[0] == written[1] == written[2]
    assert json.loads(written[0])["options"]["effort"] == "quick"
