"""python-control: transfer function, state space with samples, and the motor with its effects."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.errors import OptionError
from identification.export import export, state_space, transfer_function
from identification.pipeline import Identification
from identification.prediction import predict
from identification.speed_loop import parse_controller, step_curves
from tests.export.effects import EFFECTS
from tests.export.results import (
    CASES,
    INTERVAL,
    MOTOR,
    effect,
    inputs_of,
    result_with,
    run_of_the_motor,
)
from tests.motors import NAMES, drive, run_of

control: Any = pytest.importorskip("control", reason="python-control is not installed")

TOLERANCE = 1e-6
DRAWS = {name: value * np.linspace(0.9, 1.1, 5) for name, value in zip(NAMES, MOTOR.values)}  # noqa: B905


def module(case: str) -> SimpleNamespace:
    """Exported module of a case, executed."""
    made = export(result_with(*CASES[case]), "python-control", lambda: (DRAWS, ""), [25.0, 125.0])
    names: dict[str, Any] = {"__name__": "exported"}
    exec(compile(made.content, "motor.py", "exec"), names)  # noqa: S102  what a user imports
    return SimpleNamespace(**names)


@pytest.mark.parametrize("temperature", [25.0, 125.0])
def test_transfer_function_has_the_step_response_of_the_loop(temperature: float) -> None:
    """The library's own closed form of the loop with P:1 is the reference."""
    found = module("nominal").transfer_functions[temperature]
    values = {name: np.array([value]) for name, value in zip(NAMES, MOTOR.values, strict=True)}
    (curve,) = step_curves(values, [temperature], [parse_controller("P:1")])

    _, speed = control.step_response(control.feedback(found, 1), np.asarray(curve.time))

    np.testing.assert_allclose(speed, np.asarray(curve.median), atol=TOLERANCE)
    own = transfer_function(result_with(), temperature)
    np.testing.assert_allclose(own.num[0][0], found.num[0][0])
    np.testing.assert_allclose(own.den[0][0], found.den[0][0])


def test_state_space_follows_predict() -> None:
    """Sampled with a zero-order hold, it is the nominal model at a constant temperature."""
    rows = 500
    voltage = drive(MOTOR, "steps", rows, np.random.default_rng(1))
    run = run_of(MOTOR, voltage, np.full(rows, 125.0), np.zeros(2))
    result = result_with()
    _, state = inputs_of(result, run)
    sampled = control.sample_system(module("nominal").state_spaces[125.0], INTERVAL, "zoh")

    found = control.forced_response(
        sampled, run.time, np.vstack([voltage, np.zeros(rows)]), initial_state=state[:2]
    ).outputs

    predicted = predict(result, run)
    for row, wanted in zip(found, (predicted["current_A"], predicted["speed_rad_s"]), strict=True):
        assert np.abs(row - wanted).max() < TOLERANCE * np.ptp(wanted)


def test_samples_are_those_of_the_draws() -> None:
    """Each sample is the state space of one draw, and the best values come first in the library."""
    found = module("nominal").sampled_state_spaces[25.0]

    best, *own = state_space(result_with(), 25.0, DRAWS)

    assert len(found) == len(own) == 5
    for one, other, inductance in zip(found, own, DRAWS["L"], strict=True):
        np.testing.assert_allclose(one.A, other.A)
        assert one.B[0, 0] == pytest.approx(1.0 / inductance)
    np.testing.assert_allclose(best.A, found[2].A)


def test_identification_returns_the_systems_of_its_result_and_draws() -> None:
    """Poles at 125 degC are those of the file; samples are thinned evenly, with both ends."""
    found: Any = SimpleNamespace(draws=DRAWS)
    identification = Identification(result_with(), found)

    systems = identification.state_space(125.0, samples=3)

    plant = identification.transfer_function(125.0)
    np.testing.assert_allclose(
        np.sort(plant.poles()), np.sort(module("nominal").transfer_functions[125.0].poles())
    )
    np.testing.assert_allclose(np.sort(systems[0].poles()), np.sort(plant.poles()))
    inductances = [1.0 / one.B[0, 0] for one in systems[1:]]
    np.testing.assert_allclose(inductances, DRAWS["L"][[0, 2, 4]])
    assert len(identification.state_space(125.0)) == 1


def test_motor_with_effects_follows_predict() -> None:
    """Linear interpolation of the inputs is the first-order hold of this model."""
    case = "cogging and a first-order hold"
    result, run = result_with(*CASES[case]), run_of_the_motor(120)
    inputs, state = inputs_of(result, run)
    exported = module(case)
    given = np.vstack(
        [inputs["voltage"], inputs["temperature"], np.zeros(run.rows), inputs["angle"]]
    )

    found = control.input_output_response(
        exported.motor, run.time, given, [*state, 0.0], params={"position_given": 1.0},
        **exported.ACCURATE,
    ).outputs  # fmt: skip

    predicted = predict(result, run)
    for row, wanted in zip(
        found[:2], (predicted["current_A"], predicted["speed_rad_s"]), strict=True
    ):
        assert np.abs(row - wanted).max() < TOLERANCE * np.ptp(wanted)


def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message is the command that installs it."""
    monkeypatch.setitem(sys.modules, "control", None)

    with pytest.raises(OptionError, match=r"pip install 'motorid\[control\]'"):
        transfer_function(result_with(), 25.0)


def test_delay_that_the_equations_lack_is_said_in_the_file() -> None:
    """Continuous equations have no delay and no mean; the file names both."""
    made = export(
        result_with(*CASES["a delay and a mean"]), "python-control", lambda: (DRAWS, "few"), [25.0]
    )

    assert [remark.split()[0] for remark in made.remarks] == ["few", "channel_delay", "the"]
    assert "channel_delay is left out" in made.content.decode()


@pytest.mark.parametrize(
    ("entry", "note", "setting"),
    [
        (
            EFFECTS["demagnetization"], "the memory of the highest temperature: a loss of mag",
            'params.get("peak_temperature", 60.0)',
        ),
        (
            effect(
                "winding_lag",
                {"fastest": 0.003, "slowest": 3600.0, "direction": "the log lags the winding"},
                time_constant=0.6,
            ),
            "the slope of the temperature", 'params.get("temperature_rate", 0.0)',
        ),
    ],
    ids=["peak", "slope"],
)  # fmt: skip
def test_what_depends_on_other_instants_is_said_in_the_file(
    entry: dict[str, Any], note: str, setting: str
) -> None:
    """Continuous equations know the present inputs only; a parameter takes their place."""
    made = export(result_with(entry), "python-control", lambda: (DRAWS, ""), [25.0])

    text = made.content.decode()
    assert made.remarks[0].startswith(note)
    assert f"Not in this file: {made.remarks[0]}." in text
    assert setting in text


def test_file_is_a_program(tmp_path: Path) -> None:
    """Executed as a script, it prints the poles at each temperature."""
    import subprocess

    path = tmp_path / "motor.py"
    path.write_bytes(
        export(result_with(), "python-control", lambda: (DRAWS, ""), [25.0, 125.0]).content
    )

    said = subprocess.run([sys.executable, path], check=True, capture_output=True, text=True).stdout

    assert [line.split(":")[0] for line in said.splitlines()] == ["25 degC", "125 degC"]
