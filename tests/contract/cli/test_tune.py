"""`motorid tune`: judgement and search from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main
from tests.contract.cli.test_feedback import PAPER

DRIVE = "voltage=24,current=40,sample_time=1e-2,delay=5e-3"


def test_motor_of_the_source_has_the_margins_of_its_loop(tmp_path: Path) -> None:
    """P with gain 1 never reaches a loop gain of 1 at 125 degC: the phase margin is infinite.

    The rise time, without limits and with a short sample time, is that of Table 1 of the source.
    """
    out = tmp_path / "tuning.json"
    spec = "rise_time=0.72,phase_margin=60,sample_time=1e-3"
    words = ["tune", *PAPER, "--temperature", "25", "125", "--controller", "P:1", "--spec", spec]

    assert main([*words, "--out", str(out), "--quiet"]) == 0

    found = json.loads(out.read_text())
    cold, hot = found["controllers"][0]["temperatures"]
    assert cold["rise_time"]["median"] == pytest.approx(0.7193, abs=1e-3)
    assert hot["rise_time"]["median"] == pytest.approx(0.7144, abs=1e-3)
    assert hot["phase_margin"]["infinite_fraction"] == 1.0
    assert found["controllers"][0]["meets"]
    assert found["recommended"] is None


def test_tuned_controller_is_accepted_by_feedback(
    tmp_path: Path, fitted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The search writes a controller that `motorid feedback` takes, and both print a table."""
    out = tmp_path / "tuning.json"
    spec = "settling_time=0.2,overshoot=10,phase_margin=45,voltage=24,current=20"
    words = ["tune", str(fitted / "result.json"), "--spec", spec, "--temperature", "25:80"]

    assert main([*words, "--kind", "pi", "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    controller = found["recommended"]
    assert found["temperature_degC"] == [25.0, 38.75, 52.5, 66.25, 80.0]
    assert controller in capsys.readouterr().out
    again = ["feedback", "--result", str(fitted / "result.json"), "--controller", controller]
    assert main([*again, "--temperature", "25"]) == 0
    assert controller in capsys.readouterr().out


def test_four_controllers_fit_into_a_terminal_of_80_characters(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each metric has one line, with its unit, and each controller a column."""
    monkeypatch.setattr("app.commands.console._PIPE_WIDTH", 80)
    controllers = ["P:1", "PI:1.23,4.56", "PI+FF:1.23,4.56,0.789", "PID:0.861,1.99,9.9e-05"]
    words = ["tune", *PAPER, "--temperature", "25", "--controller", *controllers]

    assert main([*words, "--spec", "rise_time=1,sample_time=1e-2"]) == 0

    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Specification: rise_time 1 s, sample_time 0.01 s, delay 0 s"
    (rise,) = (line for line in lines if line.startswith("rise time [ms] "))
    assert rise.count(" .. ") == 4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--spec", "overshoot=-5"], "overshoot is -5 %; expected a number above 0"),
        (["--spec", "rise=1"], "rise is not known; expected rise_time"),
        (["--spec", "overshoot=5", "--temperature", "120:0"], "'120:0': expected a temperature"),
        (["--spec", "overshoot=5", "--kind", "PD"], "'PD' is not known; expected P, PI"),
        (["--spec", "overshoot=5", "--probability", "1.5"], "probability is 1.5"),
        (["--spec", "overshoot=5", "--controller", "PI:1"], "has 1 gain; PI requires 2"),
    ],
)
def test_refused_options_are_named_in_one_line(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit status 2, and what was expected."""
    assert main(["tune", *PAPER, *words]) == 2

    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
