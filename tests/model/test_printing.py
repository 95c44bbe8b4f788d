"""Printed equations: the MathML of a report, evaluated, is the model that is simulated."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest

from benchmarks.effects_page import example_scales
from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import CampaignScales
from identification.model.composite import INPUTS, MotorModel
from identification.model.printing import printed_equations

SYMBOLS = {
    "current": "i", "speed": "ω", "voltage": "v", "temperature": "T", "angle": "φ", "time": "t",
    "peak_temperature": "T|peak", "temperature_rate": "dT/dt", "Ra25": "R|25", "Kt25": "K|25",
    "alpha_Ra": "α|R", "alpha_Kt": "α|K", "voltage_next": "v|next", "interval": "h",
}  # fmt: skip
FUNCTIONS = {
    "ln": math.log, "sin": math.sin, "cos": math.cos, "tanh": math.tanh, "exp": math.exp,
    "sqrt": math.sqrt, "abs": abs, "min": min, "max": max, "sgn": np.sign,
}  # fmt: skip
OPERATORS = {"−": "-", "×": "*", "≤": "<=", "{": "", "=": "=="}


@pytest.fixture(scope="module")
def scales() -> CampaignScales:
    """Scales of the example on the page of the effects."""
    return example_scales()


def python_of(element: ElementTree.Element) -> str:
    """Python expression of a MathML element; names are looked up in ``V``."""
    kind, text = element.tag, (element.text or "").strip()
    parts = [python_of(child) for child in element]
    if kind == "mi":
        return text if text in FUNCTIONS else f"V[{text!r}]"
    if kind == "msub":
        name = "|".join((child.text or "") for child in element)
        return f"V[{name!r}]"
    if kind == "msup":
        return f"exp({parts[1]})" if parts[0] == "V['e']" else f"(({parts[0]})**({parts[1]}))"
    if kind == "mfrac":
        return f"(({parts[0]})/({parts[1]}))"
    if kind == "mtable":
        (value, condition), (other, _) = ((row[0], row[1]) for row in element)
        return f"(({python_of(value)}) if ({python_of(condition)}) else ({python_of(other)}))"
    leaf = {"mn": text, "mo": OPERATORS.get(text, text), "mspace": "*", "mtext": ""}
    if kind in leaf:
        return "not " if kind == "mtext" and text == "not" else leaf[kind]
    inside = "".join(parts)
    bars = [child for child in element if child.tag == "mo" and child.text == "|"]
    if bars:
        inside = f"abs{inside.replace('|', '(', 1)[::-1].replace('|', ')', 1)[::-1]}"
    return f"{'sqrt' if kind == 'msqrt' else ''}({inside})"


def shown(name: str) -> list[str]:
    """Ways in which a parameter or state can be shown: alone or with its effect as the index."""
    effect, _, bare = name.rpartition(".")
    base, _, index = bare.rpartition("_")
    words = bare.replace("_", " ")
    return [words, f"{words}|{effect.replace('_', ' ')}", f"{base}|{index}"]


@pytest.mark.parametrize("name", CATALOGUE)
def test_each_printed_equation_is_the_simulated_one(name: str, scales: CampaignScales) -> None:
    """Both are evaluated at one random point, inside the bounds of the parameters."""
    model = MotorModel((CATALOGUE[name].candidates(scales)[0].term,))
    rng = np.random.default_rng(4)
    point = {key: rng.uniform(0.2, 0.9) for key in (*model.state_names, *INPUTS)}
    point["substeps"] = 1.0
    values = {
        p.name: float(np.clip(rng.uniform(0.2, 0.9), p.lower, p.upper)) for p in model.parameters
    }
    symbols = model.symbols()
    rates = ca.Function("rates", [*symbols], [model.rates(*symbols)])
    states = [point[key] for key in model.state_names]
    expected = np.array(rates(states, [point[key] for key in INPUTS], list(values.values())))
    known = {"e": math.e}
    for key, value in (values | point).items():
        known |= {SYMBOLS[key]: value} if key in SYMBOLS else dict.fromkeys(shown(key), value)

    sides = {}
    for left, text in printed_equations(model).items():
        if text.startswith("<math"):
            whole = "".join(python_of(child) for child in ElementTree.fromstring(text))
            sides[left] = whole.partition("==")[2]
    auxiliary = {k: v for k, v in sides.items() if k.startswith(("u_", "R_a", "K_t"))}
    for _ in range(len(auxiliary)):
        for left, side in auxiliary.items():
            try:
                known[left.replace("_", "|")] = eval(side, {**FUNCTIONS, "V": known})  # noqa: S307
            except KeyError:
                continue
    found = [
        eval(side, {**FUNCTIONS, "V": known})  # noqa: S307
        for left, side in sides.items()
        if left.startswith("d")
    ]

    np.testing.assert_allclose(found, expected.ravel(), rtol=2e-4, atol=1e-9)


def test_an_exponential_of_a_logarithm_is_a_power_and_opposite_conditions_are_cases(
    scales: CampaignScales,
) -> None:
    """The knee of a brush drop is simulated as exp(p ln(x)) and with two conditions."""
    text = "".join(
        printed_equations(
            MotorModel((CATALOGUE["brush_drop"].candidates(scales)[0].term,))
        ).values()
    )

    assert "otherwise" in text
    assert "ln" not in text
    assert "where" not in text
