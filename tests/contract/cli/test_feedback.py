"""`motorid feedback`: speed loop of a motor given by values or by a result."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from app.cli import main
from identification.result.draws import write_posterior
from tests.export.results import FILTER, FRICTION

PAPER = [
    "--set", "Ra25=0.59", "alpha_Ra=0.004", "Kt25=0.071", "alpha_Kt=-0.002",
    "--set", "J=0.01", "--set", "b=0.1", "--set", "L=0.5",
]  # fmt: skip
NAMES = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L")


def test_motor_of_the_source_gives_its_table(tmp_path: Path) -> None:
    """The default loop, P with gain 1 at 25 and 125 degC, reproduces Table 1 of the source."""
    out = tmp_path / "feedback.json"

    assert main(["feedback", *PAPER, "--out", str(out), "--quiet"]) == 0

    cold, hot = json.loads(out.read_text())
    for name, expected in {
        "rise_time_s": (0.7193, 0.7144),
        "settling_time_s": (1.2826, 1.2781),
        "steady_state": (0.5258, 0.3982),
        "overshoot_percent": (0.0, 0.0),
    }.items():
        found = (cold[name]["median"], hot[name]["median"])
        assert tuple(round(value, 4) for value in found) == expected, name
    assert [entry["temperature_degC"] for entry in (cold, hot)] == [25.0, 125.0]


def test_json_on_standard_output_is_the_list_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Standard output and the file contain the same JSON document."""
    out = tmp_path / "feedback.json"

    assert main(["feedback", *PAPER, "--out", str(out), "--json"]) == 0

    assert json.loads(capsys.readouterr().out) == json.loads(out.read_text())


def test_table_says_unstable_and_infinite_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    """PI with an integral gain of 1e5 is unstable; P has an infinite gain margin."""
    words = ["feedback", *PAPER, "--controller", "P:1", "PI:1,1e5", "--temperature", "25"]

    assert main(words) == 0

    stable, unstable = capsys.readouterr().out.split("Speed loop, PI:1,1e5")
    assert "Gain margin [dB]" in stable
    assert stable.rstrip().endswith("infinite")
    assert "unstable: the speed does not settle" in unstable


def test_draws_of_the_posterior_of_the_result_are_used(
    fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For P with gain 1 the final value of each of three draws has a closed form."""
    motors = np.array(
        [[0.59, 0.0, 0.071, 0.0, 0.01, friction, 0.5] for friction in (0.1, 0.2, 0.4)]
    )
    result = json.loads((fitted / "result.json").read_text())
    for name, median in zip(NAMES, np.median(motors, axis=0).tolist(), strict=True):
        result["parameters"][name]["median"] = median
    (tmp_path / "result.json").write_text(json.dumps(result))
    expected = 0.071 / (0.59 * motors[:, 5] + 0.071**2 + 0.071)
    write_posterior(
        tmp_path / "posterior.nc", NAMES, ["1"] * 7, motors[:, None, :], np.zeros((3, 1)),
        acceptance=0.5,
    )  # fmt: skip

    words = ["feedback", "--result", str(tmp_path / "result.json"), "--temperature", "25", "--json"]
    assert main(words) == 0

    shown, told = capsys.readouterr()
    (entry,) = json.loads(shown)
    assert entry["steady_state"]["median"] == pytest.approx(np.median(expected))
    assert entry["steady_state"]["sd"] == pytest.approx(np.std(expected))
    assert told == ""


def test_result_without_posterior_gives_approximate_intervals(
    fitted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Medians agree with the result within 1 %; a remark on standard error gives the reason."""
    result = json.loads((fitted / "result.json").read_text())

    assert main(["feedback", "--result", str(fitted / "result.json"), "--json"]) == 0

    shown, told = capsys.readouterr()
    for found, own in zip(json.loads(shown), result["feedback"], strict=True):
        assert found["steady_state"]["median"] == pytest.approx(
            own["steady_state"]["median"], rel=0.01
        )
        assert found["steady_state"]["sd"] > 0
    assert told.startswith("motorid: no posterior.nc in the directory of result.json")


def test_malformed_posterior_is_refused(
    fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A silent fallback to independent draws would hide the damaged file."""
    shutil.copy(fitted / "result.json", tmp_path)
    (tmp_path / "posterior.nc").write_text("nothing")

    assert main(["feedback", "--result", str(tmp_path / "result.json")]) == 2

    assert "posterior.nc: is not a posterior of 'motorid fit'" in capsys.readouterr().err


def test_effects_that_the_linear_loop_lacks_are_named(
    fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Friction acts in a speed loop; the filter of a sensor only in the log."""
    result = json.loads((fitted / "result.json").read_text())
    result["effects"] = [FRICTION, FILTER]
    (tmp_path / "result.json").write_text(json.dumps(result))

    assert main(["feedback", "--result", str(tmp_path / "result.json"), "--json"]) == 0

    (told,) = [line for line in capsys.readouterr().err.splitlines() if "linear motor" in line]
    assert "without coulomb_friction;" in told
