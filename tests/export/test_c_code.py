"""C export: compiled without warnings, it follows `predict`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.export.c_code import c_code
from identification.export.model import exported_model
from identification.prediction import predict
from tests.export.compiled import CompiledMotor
from tests.export.results import CASES, STEP, effect, inputs_of, result_with, run_of_the_motor


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("tolerance", [None, 1e-9], ids=["fixed substeps", "converged"])
def test_compiled_motor_follows_predict(
    case: str, tolerance: float | None, compiled_motors: dict[str, Path]
) -> None:
    """Both integrate the same equations, so they agree to 1e-6 of the range of each signal.

    The first samples of delayed channels depend on readings before the run and are left out.
    """
    result, run = result_with(*CASES[case]), run_of_the_motor()
    inputs, state = inputs_of(result, run)
    motor = exported_model(result)
    one = CompiledMotor(compiled_motors[case], motor.step.size1_in(0), len(motor.parameters))
    one.start(state[0], state[1], float(inputs["temperature"][0]))
    one.motor.carry[: state.size] = list(state)

    readings = one.run(inputs, tolerance, angle_given=1.0)

    predicted = predict(result, run)
    first = max(edge[0] for edge in motor.model.edges)
    for k, wanted in enumerate((predicted["current_A"], predicted["speed_rad_s"])):
        error = np.abs(readings[first:, k] - wanted[first:])
        assert error.max() < 1e-6 * np.ptp(wanted), ("current", "speed")[k]


def test_equal_substeps_give_equal_numbers(compiled_motors: dict[str, Path]) -> None:
    """The linear motor needs one substep, and its error is that of rounding."""
    result, run = result_with(), run_of_the_motor(200)
    inputs, state = inputs_of(result, run)
    one = CompiledMotor(compiled_motors["nominal"], 3, 7)
    assert one.motor.substeps == 1
    one.start(state[0], state[1], 25.0)

    readings = one.run(inputs)

    np.testing.assert_allclose(
        readings[:, 1], predict(result, run)["speed_rad_s"], rtol=1e-9, atol=1e-9
    )


def test_load_torque_changes_speed_and_current_as_in_steady_state(
    compiled_motors: dict[str, Path],
) -> None:
    """V = Ra i + Kt w and Kt i = b w + T at 25 degC give the speed under a load of 0.1 N m."""
    one = CompiledMotor(compiled_motors["nominal"], 3, 7)
    rows = 4000
    inputs = {
        name: np.full(rows, 12.0 if "voltage" in name else 25.0)
        for name in ("voltage", "voltage_next", "temperature", "temperature_next")
    }

    current, speed, angle = one.run(inputs, load_torque=0.1)[-1]

    ra, kt, b = 0.6, 0.07, 1e-4
    wanted = (kt * 12.0 - ra * 0.1) / (ra * b + kt**2)
    assert speed == pytest.approx(wanted, rel=1e-6)
    assert current == pytest.approx((b * wanted + 0.1) / kt, rel=1e-6)
    assert angle == pytest.approx(speed * 4.0, rel=0.05)


def test_step_in_one_run_is_left_out_and_said() -> None:
    """A load in run 2 does not act in a new run; the note names effect and run."""
    motor = exported_model(result_with(STEP))

    assert motor.model.terms[:-1] == ()
    assert motor.notes == ("load_step acts only in runs of the campaign (run 2); it is left out",)


@pytest.mark.parametrize(
    "late",
    [
        effect("input_hold", {"law": "voltage logged at the end of its interval"}),
        effect("voltage_filter", {"fastest": 3e-4, "slowest": 0.3}, time_constant=2e-3),
    ],
    ids=lambda late: late["name"],
)
def test_a_late_voltage_is_no_part_of_the_export(late: dict[str, Any]) -> None:
    """The input is the voltage at the terminals: the same code as without the late log."""
    plain, found = (exported_model(result_with(*effects)) for effects in ((), (late,)))

    assert "voltage at the terminals" in found.notes[0]
    assert c_code(found, []) == c_code(plain, [])


def test_comment_holds_the_parameters_and_the_error_of_each_number_of_substeps() -> None:
    """A reader finds names, units and the cost of a smaller number of substeps."""
    text = c_code(exported_model(result_with(*CASES["friction, heating and a filter"])), ["X */ y"])

    assert "coulomb_friction.torque [N m]" in text
    assert "   1 substeps" in text
    assert "X * / y" in text
