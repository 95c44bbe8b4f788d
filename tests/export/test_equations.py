"""MATLAB, Simulink and Modelica: their equations, read back, are those of the model."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from identification.export import export
from identification.export.formats import FORMATS
from identification.export.model import Exported, exported_model
from identification.export.scripts import SIGNALS
from identification.model.composite import INPUTS
from tests.export.results import CASES, MOTOR, result_with
from tests.motors import NAMES

DRAWS = {name: value * np.linspace(0.9, 1.1, 5) for name, value in zip(NAMES, MOTOR.values)}  # noqa: B905
MATHEMATICS: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("exp", "log", "sin", "cos", "tanh", "sqrt")},
    "sign": lambda x: float(x > 0) - float(x < 0),
    "where": lambda condition, value: value if condition != 0 else 0.0,
}


def text_of(case: str, form: str) -> str:
    """Exported text of a case."""
    temperatures = [25.0, 125.0] if FORMATS[form].is_linear else []
    made = export(result_with(*CASES[case]), form, lambda: (DRAWS, ""), temperatures)
    return made.content.decode()


def body(text: str, function: str, form: str) -> str:
    """Assignments of one function of a file, as Python."""
    if form == "modelica":
        found = re.search(rf"function {function} .*?algorithm\n(.*?)  end {function};", text, re.S)
    else:
        found = re.search(
            rf"= motorid_{function}\(x, u, p\)\n.*?zeros.*?\n(.*?)\nend\n", text, re.S
        )
    assert found
    lines = found.group(1).replace(":=", "=").replace("^", "**").replace("double(", "float(")
    lines = re.sub(r"if (.*?) then 1.0 else 0.0", r"float(\1)", lines)
    return re.sub(
        r"\b(x|u|p|dx|y)[(\[](\d+)[)\]]", lambda m: f"{m[1]}[{int(m[2]) - 1}]", lines
    ).replace("    ", "").replace("  ", "")  # fmt: skip


def expected(motor: Exported) -> Callable[[Any, dict[str, float]], tuple[Any, Any]]:
    """Rates and readings of the model, from its expressions."""
    x, u, p = motor.model.symbols()
    function = ca.Function(
        "model", [x, u, p], [motor.model.rates(x, u, p), motor.model.logged(x, u, p)]
    )

    def evaluate(state: Any, signals: dict[str, float]) -> tuple[Any, Any]:
        inputs = np.zeros(len(INPUTS))
        for name in ("voltage", "temperature", "temperature_rate", "peak_temperature", "time"):
            inputs[INPUTS.index(name)] = signals[name]
        inputs[INPUTS.index("angle")] = signals["position"]
        values = motor.values.copy()
        values[-2:] = signals["load_torque"], signals["position_given"]
        rates, readings = function(state, inputs, values)
        return np.asarray(rates).ravel(), np.asarray(readings).ravel()

    return evaluate


@pytest.mark.parametrize("form", ["matlab", "simulink-m", "modelica"])
@pytest.mark.parametrize("case", CASES)
def test_equations_of_the_file_are_those_of_the_model(case: str, form: str) -> None:
    """Evaluated at random states and inputs, they agree to rounding."""
    motor = exported_model(result_with(*CASES[case]))
    text, reference = text_of(case, form), expected(motor)
    rng = np.random.default_rng(7)
    for _ in range(5):
        state = rng.normal(size=len(motor.model.state_names)) * 10.0
        signals = dict(zip(SIGNALS, rng.uniform(0.1, 30.0, len(SIGNALS)), strict=True))
        signals["position_given"] = float(rng.integers(0, 2))
        names: dict[str, Any] = {
            **MATHEMATICS, "x": state, "u": [signals[name] for name in SIGNALS],
            "p": [value for _, value in motor.parameters], "dx": [0.0] * state.size,
            "y": [0.0, 0.0],
        }  # fmt: skip

        for function in ("rates", "readings"):
            exec(body(text, function, form), names)  # noqa: S102  text that this test made

        rates, readings = reference(state, signals)
        np.testing.assert_allclose(names["dx"], rates, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(names["y"], readings, rtol=1e-12, atol=1e-9)


def test_matlab_script_holds_the_transfer_function_and_its_samples() -> None:
    """The numbers of the transfer function are gain and denominator in closed form."""
    text = text_of("nominal", "matlab")
    ra, _, kt, _, inertia, b, inductance = MOTOR.values

    found = re.search(r"motor\(1\)\.tf = tf\((\S+), \[1\.0, (\S+), (\S+)\],", text)

    assert found
    product = inductance * inertia
    wanted = (kt / product, ra / inductance + b / inertia, (ra * b + kt**2) / product)
    np.testing.assert_allclose([float(one) for one in found.groups()], wanted, rtol=1e-12)
    assert text.count("motorid_a(:, :, 5) = ") == 2
    assert "motor(2).temperature = 125.0;" in text


@pytest.mark.parametrize("form", ["matlab", "simulink-m"])
def test_brackets_and_blocks_of_a_matlab_file_are_balanced(form: str) -> None:
    """Each function, if and for has its end; each line closes its brackets, or continues."""
    text = re.sub(r"'[^'\n]*'", "''", text_of("friction, heating and a filter", form))
    code = "\n".join(line.partition("%")[0].rstrip() for line in text.splitlines())

    assert code.count("(") == code.count(")")
    assert code.count("[") == code.count("]")
    opened = re.findall(r"^\s*(?:function|if|for)\b", code, re.M)
    assert len(opened) == len(re.findall(r"^\s*end\b", code, re.M))


def test_simulink_script_connects_each_block() -> None:
    """Each block that is added has a line, and a delayed channel has its Transport Delay."""
    text = text_of("a delay and a mean", "simulink-m")

    added = set(re.findall(r"add_block\('[^']*', \[name '/(\w+)'\]", text))
    lines = re.findall(r"add_line\(name, '(\w+)/\d', '(\w+)/\d'\)", text)
    assert {block for line in lines for block in line} == added
    assert "'DelayTime', '0.0023'" in text
    assert ("delay_speed", "speed") in lines
    assert "speed_filter) is left out" in text


def test_modelica_model_has_a_unit_and_an_equation_for_each_variable() -> None:
    """Each state has one derivative; units follow the syntax of Modelica."""
    text = text_of("friction, heating and a filter", "modelica")

    states = re.findall(r"^  Real (x_\w+)\(unit", text, re.M)
    assert states == re.findall(r"der\((\w+)\) = dx", text)
    assert 'parameter Real J(unit = "kg.m2")' in text
    assert 'parameter Real coulomb_friction_torque(unit = "N.m")' in text
    assert 'Real x_self_heating_rise(unit = "K"' in text
    assert "delay(y[2], 0.0023)" in text_of("a delay and a mean", "modelica")
    ends = re.findall(r"^\s*end (\w+);", text, re.M)
    assert ends == ["rates", "readings", "MotoridMotor"]
