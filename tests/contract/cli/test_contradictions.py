"""`motorid fit` of runs that contradict: refused, corrected, set aside, or forced."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from app.cli import main
from tests.contract.cli.test_warnings import FAST, edited


@pytest.fixture
def flipped(run_files: list[Path], tmp_path: Path) -> list[str]:
    """Two sound runs, and one whose current sensor is the wrong way round."""
    wrong = edited(run_files[1], tmp_path / "wrong.csv", "current_A", lambda value: -value)
    return [str(run_files[0]), str(wrong), str(run_files[2])]


def fitted(out: Path, *words: str) -> dict[str, Any]:
    """The result of a quick fit."""
    assert main(["fit", *words, "--out", str(out), *FAST]) == 0
    result: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return result


def test_the_correction_that_a_refusal_proposes_can_be_typed(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, exit status 2, nothing written; with its words the same runs are fitted."""
    assert main(["fit", *flipped, "--out", str(tmp_path / "no"), *FAST]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "wrong.csv, column current_A: has the wrong sign" in line
    assert not (tmp_path / "no" / "result.json").exists()
    [words] = re.findall(r"--map '([^']*)'", line)

    result = fitted(tmp_path / "out", *flipped, "--map", words)

    assert words == "wrong.csv:current_A=current_A * -1"
    assert result["checks"] == []
    assert result["forced"] is False


def test_all_contradictions_are_said_at_once(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two faults in two runs: a user types both corrections, and not one after another."""
    other = edited(Path(flipped[2]), tmp_path / "other.csv", "speed_rad_s", lambda value: -value)

    status = main(["fit", flipped[0], flipped[1], str(other), "--out", str(tmp_path), *FAST])

    [line] = capsys.readouterr().err.splitlines()
    assert status == 2
    assert line.startswith("motorid: 2 contradictions in the runs")
    assert "wrong.csv:current_A=current_A * -1" in line
    assert "other.csv:speed_rad_s=speed_rad_s * -1" in line


def test_a_run_that_contradicts_is_set_aside_and_said(flipped: list[str], tmp_path: Path) -> None:
    """The two that are left are those that are fitted without it."""
    result = fitted(tmp_path / "out", *flipped, "--set-aside")
    alone = fitted(tmp_path / "alone", flipped[0], flipped[2])

    assert [run["file"] for run in result["set_aside"]] == ["wrong.csv"]
    assert result["warnings"][0].startswith(
        "run set aside (neither fitted nor used for validation): wrong"
    )
    assert result["parameters"] == alone["parameters"]
    assert result["forced"] is False


def test_a_forced_fit_is_marked(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the result, first among the warnings, and first in the summary of the report."""
    result = fitted(tmp_path / "out", *flipped, "--force")

    assert result["forced"] is True
    assert result["checks"][0]["code"] == "reversed_channel"
    assert result["warnings"][0].startswith(
        "do not rely on this result: it was fitted with --force although the runs contradict"
    )
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "The runs contradict the motor equations or each other" in report
    assert "does not exceed the sensor noise" not in report
    assert not re.search(r"The runs determine all \d+ parameters", report)
    assert "Warning: do not rely on this result" in capsys.readouterr().out


def test_a_mapping_of_a_file_that_is_not_given_is_refused(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A misspelt name would otherwise be a correction that nobody applies."""
    words = ["--map", "wronk.csv:current_A=current_A * -1"]

    assert main(["fit", *flipped, *words, "--out", str(tmp_path), *FAST]) == 2
    assert "the mapping has an entry for the file 'wronk.csv'" in capsys.readouterr().err
