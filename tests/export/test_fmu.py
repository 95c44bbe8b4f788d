"""FMU: valid for FMPy, it follows `predict` in FMI 2.0 and 3.0."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.export.fmu import fmu
from identification.export.model import exported_model
from identification.prediction import predict
from tests.export.results import CASES, INTERVAL, inputs_of, result_with, run_of_the_motor

fmpy: Any = pytest.importorskip("fmpy", reason="FMPy is not installed")
validation: Any = pytest.importorskip("fmpy.validation")
fmi2: Any = pytest.importorskip("fmpy.fmi2")
COMPILED = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler 'cc'")
TOLERANCE = 1e-6
ABSENT_IN_CO_SIMULATION_2 = {
    "EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep",
    "SetTime", "SetContinuousStates", "GetDerivatives", "GetEventIndicators",
    "GetContinuousStates", "GetNominalsOfContinuousStates",
}  # fmt: skip

Array = NDArray[np.floating[Any]]


def written(case: str, fmi: Literal[2, 3], folder: Path) -> Path:
    """FMU of a case in a file."""
    path = folder / f"motor{fmi}.fmu"
    path.write_bytes(fmu(exported_model(result_with(*CASES[case])), ["Case <&>."], fmi)[0])
    return path


def signals(time: Array, columns: Mapping[str, Array]) -> NDArray[np.void]:
    """Inputs as FMPy expects them."""
    rows = np.zeros(time.size, dtype=[("time", float), *((name, float) for name in columns)])
    rows["time"] = time
    for name, values in columns.items():
        rows[name] = values
    return rows


@COMPILED
@pytest.mark.parametrize(
    ("case", "fmi"),
    [
        ("nominal", 3),
        ("friction, heating and a filter", 2),
        ("cogging and a first-order hold", 3),
        ("a delay and a mean", 2),
    ],
)
def test_fmu_is_valid_and_follows_predict(case: str, fmi: Literal[2, 3], tmp_path: Path) -> None:
    """Both integrate the same equations, so they agree to 1e-6 of the range of each signal.

    Slopes of the inputs give the values at the next sample.  The first samples of delayed channels
    depend on readings before the run and are left out.
    """
    result, run = result_with(*CASES[case]), run_of_the_motor()
    motor, predicted = exported_model(result), predict(result, run)
    inputs, state = inputs_of(result, run)
    path = written(case, fmi, tmp_path)
    assert validation.validate_fmu(str(path)) == []
    given = {"voltage": "voltage", "temperature": "temperature", "position": "angle"}
    columns = {name: inputs[own] for name, own in given.items()}
    columns |= {
        f"{name}_rate": (inputs[f"{own}_next"] - inputs[own]) / INTERVAL
        for name, own in given.items()
    }
    columns["load_torque"] = np.zeros(run.rows)
    if motor.model.held == "zoh":
        columns["voltage_rate"] = np.zeros(run.rows)

    found = fmpy.simulate_fmu(
        str(path),
        start_values={
            "position_given": 1.0,
            **{f"state.{k}": v for k, v in zip(motor.model.state_names, state, strict=False)},
        },
        input=signals(run.time, columns),
        output=["current", "speed"],
        stop_time=run.time[-1],
        output_interval=INTERVAL,
    )

    first = max(edge[0] for edge in motor.model.edges)
    for name, wanted in (("current", predicted["current_A"]), ("speed", predicted["speed_rad_s"])):
        error = np.abs(found[name][: run.rows] - wanted)[first:]
        assert error.max() < TOLERANCE * np.ptp(wanted), name


@COMPILED
def test_input_derivatives_of_fmi_2_are_slopes(tmp_path: Path) -> None:
    """Under a first-order hold, derivatives set by the importer act like the slope inputs."""
    path = written("cogging and a first-order hold", 2, tmp_path)
    description = fmpy.read_model_description(str(path))
    reference = {one.name: one.valueReference for one in description.modelVariables}
    folder = fmpy.extract(str(path), tmp_path / "extracted")

    def speed_after_a_ramp(*, derivative: bool) -> float:
        one = fmi2.FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier="motor", instanceName="m"
        )
        one.instantiate()
        one.setupExperiment(startTime=0.0)
        one.enterInitializationMode()
        one.exitInitializationMode()
        if derivative:
            one.setRealInputDerivatives([reference["voltage"]], [1], [600.0])
        else:
            one.setReal([reference["voltage_rate"]], [600.0])
        for k in range(20):
            one.setReal([reference["voltage"]], [600.0 * k * INTERVAL])
            one.doStep(k * INTERVAL, INTERVAL)
        (speed,) = one.getReal([reference["speed"]])
        one.terminate()
        one.freeInstance()
        return float(speed)

    assert speed_after_a_ramp(derivative=True) == speed_after_a_ramp(derivative=False) > 1.0


@COMPILED
@pytest.mark.parametrize(
    ("case", "factor", "accepted"),
    [("nominal", 2.5, True), ("a delay and a mean", 2.0, True), ("a delay and a mean", 2.5, False)],
)
def test_communication_step_of_any_size_unless_the_model_counts_samples(
    case: str, factor: float, accepted: bool, tmp_path: Path
) -> None:
    """A delay counts sample intervals, so a step that is no multiple of them is refused."""
    path = written(case, 3, tmp_path)
    said: list[str] = []
    step = factor * INTERVAL

    def simulated() -> float:
        found = fmpy.simulate_fmu(
            str(path), start_values={"voltage": 12.0}, output=["speed"], stop_time=200 * step,
            output_interval=step, validate=False,
            logger=lambda environment, status, category, message: said.append(message.decode()),
        )  # fmt: skip
        return float(found["speed"][-1])

    if not accepted:
        with pytest.raises(Exception, match="fmi3DoStep"):
            simulated()
        assert "no multiple of the sample interval" in said[0]
        return
    assert simulated() == pytest.approx(12.0 / 0.07, rel=0.05)


@COMPILED
@pytest.mark.parametrize("fmi", [2, 3])
def test_library_defines_every_function_of_the_standard(fmi: Literal[2, 3], tmp_path: Path) -> None:
    """The names are those of the standard's header, which FMPy ships."""
    folder = Path(fmpy.__file__).parent / "c-code"
    header = (folder / f"fmi{fmi}FunctionTypes.h").read_text(encoding="utf-8")
    wanted = {name for name in re.findall(rf"fmi{fmi}(\w+)TYPE", header)}
    with zipfile.ZipFile(written("nominal", fmi, tmp_path)) as archive:
        source = archive.read("sources/motor_fmu.c").decode()
    (tmp_path / "fmu.c").write_text(source, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]
    subprocess.run(
        ["cc", *strict, tmp_path / "fmu.c", "-o", tmp_path / "fmu.so", "-lm"], check=True
    )
    symbols = subprocess.run(
        ["nm", "-D", "--defined-only", tmp_path / "fmu.so"],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip

    defined = set(re.findall(rf" T fmi{fmi}(\w+)", symbols))

    assert wanted - defined - (ABSENT_IN_CO_SIMULATION_2 if fmi == 2 else set()) == set()


def test_fmu_without_a_compiler_holds_sources_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The remark says what to do; equal results give equal archives."""
    monkeypatch.setattr(shutil, "which", lambda name: None)
    motor = exported_model(result_with())

    content, remarks = fmu(motor, [], 3)

    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert set(archive.namelist()) == {
            "modelDescription.xml", "sources/motor_fmu.c", "sources/buildDescription.xml",
        }  # fmt: skip
    assert "has no C compiler 'cc'" in remarks[0]
    assert fmu(motor, [], 3)[0] == content
