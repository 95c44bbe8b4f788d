"""Effects of a result that was edited or that another program wrote."""

from __future__ import annotations

from typing import Any

import pytest

from identification.effects.periodic import CoggingTorque
from identification.errors import InputError
from identification.model.composite import MotorModel
from identification.model.parameter import Parameter
from identification.prediction import model_of
from identification.surrogates.entry import term_of

COGGING = {"name": "cogging_torque", "settings": {"torque_size": 0.1}}
INTERNALS = ("__init__", "argument", "object is", "indices", "unhashable", "unpack", "Error")


def result(*effects: object, **changes: object) -> dict[str, Any]:
    """Result with all nominal parameters and effects."""
    declared: tuple[Parameter, ...] = MotorModel().parameters
    parameters = {parameter.name: {"median": 0.5} for parameter in declared}
    whole = {"declared": {"hold": "zoh", "parameters": parameters}, "parameters": parameters}
    return {**whole, "effects": list(effects), **changes}


def test_entry_becomes_the_term_that_it_describes() -> None:
    """Omitted members have their defaults."""
    assert term_of(COGGING) == CoggingTorque(torque_size=0.1)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (result({"name": "cogging_torque"}), "cogging_torque .* lacks the setting torque_size"),
        (result({"name": "load_step", "settings": {"run": 1}}), "lacks the setting torque_size"),
        (result({"name": "input_hold", "settings": {"x": 1}}), "setting 'x'; expected none"),
        (result({**COGGING, "settings": {"torque_size": "x"}}), "torque_size 'x'; expected a numb"),
        (
            result({**COGGING, "settings": 5}),
            "settings of the effect cogging_torque are not an obj",
        ),
        (result(COGGING), "effect cogging_torque of the result lacks the parameter [a-z0-9_]+;"),
        (result({**COGGING, "parameters": [1]}), "cogging_torque of the result has no object 'par"),
        (result({"name": "unlisted"}), "effect unlisted has no law with the settings none"),
        (result({"name": "ghost"}), "effect 'ghost' is not known; expected one of coulomb_fricti"),
        (result({"name": ["x"]}), "an effect of the result has no name"),
        (result("x"), "an effect of the result has no name"),
        (result(effects=5), "the result has no list 'effects'"),
        (result(declared=5), "the result has no object 'declared'"),
        (result(parameters=[1]), "the result has no object 'parameters'"),
        (result(parameters={"Ra25": 5}), "the result has no value of Ra25"),
        ({}, "the result has no object 'declared'"),
    ],
)
def test_what_a_result_lacks_is_said_in_its_own_words(content: dict[str, Any], told: str) -> None:
    """The message names the effect, the missing member and the remedy."""
    with pytest.raises(InputError, match=told) as caught:
        model_of(content)

    assert not any(word in str(caught.value) for word in INTERNALS)
    assert "'motorid fit'" in str(caught.value) or "expected" in str(caught.value)
