"""`motorid fit` of contradictory runs: rejected, corrected, set aside, or forced."""

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
    """Two valid runs, and between them one with a reversed current sensor."""
    wrong = edited(run_files[1], tmp_path / "wrong.csv", "current_A", lambda value: -value)
    return [str(run_files[0]), str(wrong), str(run_files[2])]


def fitted(out: Path, *words: str) -> dict[str, Any]:
    """Result of a quick fit."""
    assert main(["fit", *words, "--out", str(out), *FAST]) == 0
    result: dict[str, Any] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return result


def test_the_proposed_correction_is_valid(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the --map option of the error message, the fit of the same runs succeeds."""
    assert main(["fit", *flipped, "--out", str(tmp_path / "no"), *FAST]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "wrong.csv, column current_A: has the wrong sign" in line
    assert not (tmp_path / "no" / "result.json").exists()
    [words] = re.findall(r"--map '([^']*)'", line)

    result = fitted(tmp_path / "out", *flipped, "--map", words)

    assert words == "wrong.csv:current_A=current_A * -1"
    assert result["checks"] == []
    assert result["forced"] is False


def test_one_message_lists_all_contradictions(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For two faults in two runs the message proposes both corrections."""
    other = edited(Path(flipped[2]), tmp_path / "other.csv", "speed_rad_s", lambda value: -value)

    status = main(["fit", flipped[0], flipped[1], str(other), "--out", str(tmp_path), *FAST])

    [line] = capsys.readouterr().err.splitlines()
    assert status == 2
    assert line.startswith("motorid: 2 contradictions in the runs")
    assert "wrong.csv:current_A=current_A * -1" in line
    assert "other.csv:speed_rad_s=speed_rad_s * -1" in line


def test_a_contradictory_run_is_set_aside_and_reported(flipped: list[str], tmp_path: Path) -> None:
    """The parameters equal those of a fit without the run."""
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
    """The result, its first warning and the report summary state that the fit was forced."""
    result = fitted(tmp_path / "out", *flipped, "--force")

    assert result["forced"] is True
    assert result["checks"][0]["code"] == "reversed_channel"
    assert result["warnings"][0].startswith(
        "do not rely on this result: it was fitted with --force (option force) although "
        "the runs contradict"
    )
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "The runs contradict the motor equations or each other" in report
    assert "does not exceed the sensor noise" not in report
    assert not re.search(r"The runs determine all \d+ parameters", report)
    assert "Warning: do not rely on this result" in capsys.readouterr().out


def test_a_mapping_of_a_file_that_is_not_given_is_refused(
    flipped: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A misspelt file name would otherwise leave the run uncorrected."""
    words = ["--map", "wronk.csv:current_A=current_A * -1"]

    assert main(["fit", *flipped, *words, "--out", str(tmp_path), *FAST]) == 2
    assert "the mapping has an entry for the file 'wronk.csv'" in capsys.readouterr().err
