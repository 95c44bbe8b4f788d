"""The published campaigns are small and reproducible."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from bench.declared import fit_declared
from bench.make_data import RECIPES, check, main

DATA = Path(__file__).parents[2] / "data"


def test_program_makes_the_published_files_again() -> None:
    """Every byte of every file follows from the seeds in the recipes."""
    assert check(DATA) == []


def test_check_names_the_files_that_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Negative control: an empty folder differs in every file."""
    assert main(["--check", "--data", str(tmp_path)]) == 1
    assert "paper_motor/training_1.csv: differs" in capsys.readouterr().out


def test_sums_are_those_of_the_files() -> None:
    """Reference: hashlib; the README contains every checksum."""
    lines = (DATA / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    readme = (DATA / "README.md").read_text(encoding="utf-8")

    for line in lines:
        told, name = line.split("  ")
        assert hashlib.sha256((DATA / name).read_bytes()).hexdigest() == told
        assert told in readme
    assert len(lines) == 8 * len(RECIPES)


@pytest.mark.parametrize("name", list(RECIPES))
def test_campaign_is_small_enough_for_git(name: str) -> None:
    """A campaign has at most 1.5 MB, five training runs and two validation runs."""
    files = list((DATA / name).iterdir())

    assert sum(path.stat().st_size for path in files) <= 1_500_000
    assert len([path for path in files if path.name.startswith("training_")]) == 5
    assert len([path for path in files if path.name.startswith("validation_")]) == 2


def test_one_campaign_has_a_detectable_effect_and_the_others_none() -> None:
    """The nominal model explains the clean campaigns down to their noise, and not the other."""
    ratios = {name: fit_declared(recipe.make()).held_out for name, recipe in RECIPES.items()}

    for name, ratio in ratios.items():
        truth = json.loads((DATA / name / "truth.json").read_text(encoding="utf-8"))
        if truth["effects"]:
            assert ratio > 1.5
        else:
            assert ratio < 1.02
    assert sum(ratio > 1.5 for ratio in ratios.values()) == 1
