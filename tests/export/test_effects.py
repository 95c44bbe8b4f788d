"""Each effect that can be exported follows `predict` to a millionth of the peak of each channel."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.effects.catalogue import CATALOGUE
from identification.export import export
from identification.export.c_code import c_code
from identification.export.model import exported_model
from identification.prediction import predict, simulation_of
from tests.export.compiled import CompiledMotor, compiled
from tests.export.effects import EFFECTS, NOT_EXPORTED, OWN_PHASE
from tests.export.results import (
    HOLD,
    MOTOR,
    inputs_of,
    result_with,
    run_of_the_motor,
)
from tests.motors import NAMES

OF_SAMPLES = {
    "channel_delay", "speed_filter, a mean", "speed_filter, a mean of samples", "input_hold",
}  # fmt: skip
"""Effects that continuous equations lack, and the hold, which the others have as well."""

DRAWS = {name: np.array([value]) for name, value in zip(NAMES, MOTOR.values, strict=True)}

Array = NDArray[np.float64]


def assert_close(readings: Array, wanted: Array, first: int = 0) -> None:
    """Both have current and speed, (n_sample, 2), equal to 1e-6 of the peak from a sample on."""
    error = np.abs(readings - wanted)[first:].max(axis=0) / np.abs(wanted).max(axis=0)
    assert error.max() < 1e-6, dict(zip(("current", "speed"), error, strict=True))


def predicted(result: dict[str, Any], rows: int) -> tuple[Array, dict[str, Array], Array]:
    """Current and speed of a prediction (n_sample, 2), its inputs, and its initial state."""
    run = run_of_the_motor(rows)
    frame = predict(result, run)
    return frame[["current_A", "speed_rad_s"]].to_numpy(), *inputs_of(result, run)


def test_every_effect_of_the_catalogue_is_tested_or_named_as_not_exported() -> None:
    """A new effect has to be in one of the lists."""
    tested = {entry["name"] for entry in EFFECTS.values()}

    assert tested | NOT_EXPORTED == set(CATALOGUE)
    assert not tested & NOT_EXPORTED


@pytest.mark.parametrize("name", EFFECTS)
def test_compiled_effect_follows_predict(name: str, tmp_path: Path) -> None:
    """With the substeps that the file has chosen, and with those of the FMU.

    The first samples of delayed channels depend on readings before the run and are left out.
    """
    result = result_with(EFFECTS[name])
    wanted, inputs, state = predicted(result, 600)
    motor = exported_model(result)
    library = compiled(c_code(motor, [name]), tmp_path)
    first = max(edge[0] for edge in motor.model.edges)
    for tolerance in (None, 1e-9):
        one = CompiledMotor(library, motor.step.size1_in(0), len(motor.parameters))
        one.start(state[0], state[1], float(inputs["temperature"][0]))
        one.motor.carry[: state.size] = list(state)

        readings = one.run(inputs, tolerance, angle_given=1.0)

        assert_close(readings[:, :2], wanted, first)


def test_compiled_cogging_with_a_phase_of_its_own_follows_predict(tmp_path: Path) -> None:
    """The substeps suffice for amplitudes that are states, set when the simulation starts."""
    result, run = result_with(OWN_PHASE), run_of_the_motor()
    simulator, values, _ = simulation_of(result, run)
    state = np.array([2.0, 60.0, 0.05, 0.015, 0.01, 0.005, 0.0])
    accurate = simulator.converged(values, [state])
    wanted = accurate.logged(values[:, None], [state])[0][:, :, 0]
    inputs, _ = inputs_of(result, run)
    motor = exported_model(result)
    one = CompiledMotor(compiled(c_code(motor, []), tmp_path), state.size, len(motor.parameters))
    one.start(state[0], state[1], float(inputs["temperature"][0]))
    one.motor.carry[:] = list(state)

    assert_close(one.run(inputs)[:, :2], wanted)


@pytest.mark.parametrize("name", [name for name in EFFECTS if name not in OF_SAMPLES])
def test_effect_in_python_control_follows_predict(name: str) -> None:
    """Linear interpolation of the inputs is the first-order hold of this model.

    An earlier run was hotter: `predict` raises the peak temperature at the samples only.
    """
    control: Any = pytest.importorskip("control", reason="python-control is not installed")
    result = result_with(EFFECTS[name], HOLD)
    result["runs"][0]["hottest_degC"] = 70.0
    wanted, inputs, state = predicted(result, 60)
    made = export(result, "python-control", lambda: (DRAWS, ""), [25.0])
    names: dict[str, Any] = {"__name__": "exported"}
    exec(compile(made.content, "motor.py", "exec"), names)  # noqa: S102  what a user imports
    motor = SimpleNamespace(**names)
    given = np.vstack(
        [inputs["voltage"], inputs["temperature"], np.zeros(len(wanted)), inputs["angle"]]
    )
    own = {"position_given": 1.0, "temperature_rate": float(inputs["temperature_rate"][0])}

    found = control.input_output_response(
        motor.motor, inputs["time"], given, [*state, 0.0], params=own,
        **motor.ACCURATE,
    ).outputs  # fmt: skip

    assert_close(found[:2].T, wanted)
