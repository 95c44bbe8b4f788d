"""`motorid design`: a profile and its expected gain as files, and one line for each refusal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main

PLATE = ["--nameplate", "voltage=12", "no_load_speed=3000rpm", "stall_current=4"]


def test_design_writes_a_profile_and_describes_it(
    fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The profile has the rows that duration times rate give, and keeps the limits of the user."""
    out = tmp_path / "next.csv"
    words = ["--limit", "voltage=5", "current=2", "--duration", "0.5", "--rate", "1000"]

    status = main(["design", str(fitted / "result.json"), "--out", str(out), *words])

    assert status == 0
    header, *rows = out.read_text(encoding="utf-8").splitlines()
    assert header == "time_s,voltage_V,temperature_degC"
    assert len(rows) == 500
    assert max(abs(float(row.split(",")[1])) for row in rows) <= 5.0
    assert float(rows[-1].split(",")[1]) == 0.0
    entry = json.loads(out.with_name("next.csv.json").read_text(encoding="utf-8"))
    assert entry["predicted_peaks"]["current"] <= 2.0
    assert entry["summary"][0] in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "--nameplate"),
        ([*PLATE, "--limit", "torque=3"], "torque"),
        ([*PLATE, "--duration", "1e6"], "samples"),
        ([*PLATE, "--rate", "1e12"], "shortest time constant of the motor; give a longer duration"),
        ([*PLATE, "--narrow", "Rb25"], "Ra25"),
        (["--nameplate", "voltage=12", "no_load_speed=3000rpm"], "stall_current"),
    ],
)
def test_refusal_is_one_line_and_writes_nothing(
    words: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names what was expected; the exit status is 2."""
    out = tmp_path / "next.csv"

    status = main(["design", *words, "--out", str(out)])

    error = capsys.readouterr().err
    assert status == 2
    assert error.count("\n") == 1
    assert expected in error
    assert not list(tmp_path.iterdir())
