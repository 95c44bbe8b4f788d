"""Warnings of `motorid fit` about implausible runs, with file and column."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli import main
from identification import pipeline
from identification.errors import ComputationError
from identification.posterior.density import Posterior

ROOT = Path(__file__).parents[3]
FAST = ["--no-posterior", "--no-effects"]


def edited(file: Path, to: Path, column: str, change: Callable[[float], float]) -> Path:
    """Copy of a run file with one column changed."""
    header, *rows = file.read_text(encoding="utf-8").splitlines()
    place = header.split(",").index(column)
    lines = [header]
    for row in rows:
        cells = row.split(",")
        cells[place] = f"{change(float(cells[place])):.9g}"
        lines.append(",".join(cells))
    to.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return to


def fitted_with(out: Path, *words: object) -> list[str]:
    """Warnings of a quick fit, forced in spite of contradictions."""
    assert main(["fit", *map(str, words), "--out", str(out), *FAST, "--force"]) == 0
    warnings: list[str] = json.loads((out / "result.json").read_text())["warnings"]
    return warnings


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("speed_rad_s", -1.0, "has the wrong sign"),
        ("current_A", 0.0, "is constant: all samples are 0"),
    ],
)
def test_a_warning_about_a_channel_names_its_column(
    run_files: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    column: str,
    factor: float,
    words: str,
) -> None:
    """A reversed or unplugged sensor is named on the terminal, in the result and in the report."""
    wrong = edited(run_files[1], tmp_path / "wrong.csv", column, lambda value: factor * value)

    warnings = fitted_with(tmp_path / "out", run_files[0], wrong)

    expected = f"wrong.csv, column {column}: {words}"
    assert [w for w in warnings if w.startswith(expected)]
    assert f"Warning: {expected}" in capsys.readouterr().out
    assert expected in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_python_warnings_are_not_shown_to_users(tmp_path: Path) -> None:
    """A new interpreter is needed, because pytest turns warnings into errors."""
    program = """
import numpy
import app.commands.motor
from app.cli import main
app.commands.motor.fit = lambda *words, **more: numpy.float64(1e300) * numpy.float64(1e300)
assert main(["fit", "run.csv", "--out", "out"]) == 0
numpy.float64(1e300) * numpy.float64(1e299)
"""
    run = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )

    # A warning outside a command, as in the last line, is still shown.
    assert run.stderr.count("RuntimeWarning: overflow encountered") == 1
    assert "<string>:7" in run.stderr
    assert run.stdout == ""


def test_a_fit_with_one_reversed_speed_sensor_succeeds(
    run_files: list[Path], tmp_path: Path
) -> None:
    """The simulation overflows in some optimiser steps, which is no error."""
    wrong = edited(run_files[1], tmp_path / "wrong.csv", "speed_rad_s", lambda value: -value)

    assert fitted_with(tmp_path / "out", run_files[0], wrong)


def test_a_coarse_current_resolution_is_reported(run_files: list[Path], tmp_path: Path) -> None:
    """The noise is 0.1 A, so samples in steps of 2 A have correlated errors."""
    coarse = [
        edited(file, tmp_path / file.name, "current_A", lambda value: 2.0 * round(value / 2.0))
        for file in run_files[:2]
    ]

    warnings = fitted_with(tmp_path / "out", *coarse)

    assert [
        w for w in warnings if w.startswith("run1.csv, run2.csv, current_A: logged in steps of")
    ]


def test_a_failed_fit_reports_the_warnings_of_its_runs(
    run_files: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without a result, the one-line error message carries the warnings."""

    def impossible(*words: object) -> None:
        raise ComputationError("no model can be simulated")

    monkeypatch.setattr(pipeline, "fit_declared", impossible)
    turned = [
        edited(file, tmp_path / file.name, "current_A", lambda value: -value)
        for file in run_files[:2]
    ]

    status = main(["fit", *map(str, turned), "--out", str(tmp_path / "out"), *FAST, "--force"])

    [line] = capsys.readouterr().err.splitlines()
    assert status == 1
    assert line.startswith("motorid: no model can be simulated; what was noticed in the runs may")
    assert "run1.csv, column current_A: has the wrong sign" in line
    assert line.endswith("(1 more such remarks)")


def test_a_fit_succeeds_with_draws_rounded_below_their_bound(
    run_files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Draws of an undetermined b can be -1e-20, which the loop metrics alone would reject."""
    drawn = Posterior.normal_draws

    def below(*words: Any) -> dict[str, Any]:
        draws = drawn(*words)
        return draws | {"b": np.where(np.arange(draws["b"].size) % 50 == 0, -1e-20, draws["b"])}

    monkeypatch.setattr(Posterior, "normal_draws", below)

    assert fitted_with(tmp_path / "out", *run_files[:2]) == []


def test_equal_samples_do_not_count_as_validation(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A copy with different bytes gives a warning and no validation verdict."""
    copy = tmp_path / "run1.csv"
    copy.write_text(run_files[0].read_text(encoding="utf-8") + "\n", encoding="utf-8")

    [told] = fitted_with(tmp_path / "out", run_files[0], "--validation", copy)

    assert "run1.csv hold the same samples" in told
    shown = capsys.readouterr().out
    assert "so there is no independent validation" in shown
    assert "not used in the fit" not in shown
    runs = json.loads((tmp_path / "out" / "result.json").read_text())["runs"]
    assert [run["same_as"] for run in runs] == [None, 0]
