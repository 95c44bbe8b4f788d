"""Results that were edited by hand: used, or refused in one message."""

from __future__ import annotations

import copy
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.errors import IdentificationError, InputError
from identification.ingest import Run
from identification.prediction import hottest_of, predict
from identification.quantities import DECLARED_PARAMETERS
from identification.result.draws import normal_draws
from identification.result.tables import TableName, result_table
from identification.tuning import motor_of
from tests.motors import NAMES, motor_named

SERVO = motor_named("servo 100 W")
TIME = np.arange(60, dtype=np.float64) * SERVO.interval
VOLTAGE = np.where(np.arange(60) // 10 % 2 == 0, 10.0, -10.0)
RUN = Run("run.csv", "a", TIME, VOLTAGE, np.zeros(60), np.zeros(60))

ENTRIES = {
    name: {"median": value, "mean": value, "sd": 0.01 * abs(value)}
    for name, value in zip(NAMES, SERVO.values, strict=True)
}
RESULT: dict[str, Any] = {
    "parameters": ENTRIES,
    "declared": {"hold": "zoh", "parameters": ENTRIES},
    "effects": [],
    "noise": {"current_A": 0.01, "speed_rad_s": 0.1},
    "runs": [{"sha256": "b", "hottest_degC": 60.0}],
    "correlation": {
        "names": list(DECLARED_PARAMETERS),
        "matrix": np.eye(len(DECLARED_PARAMETERS)).tolist(),
    },
}
PLACES: list[tuple[Any, ...]] = [
    *((name,) for name in RESULT),
    *(("parameters", name) for name in NAMES),
    *(("parameters", "J", key) for key in ("median", "mean", "sd")),
    ("declared", "hold"),
    ("declared", "parameters"),
    ("noise", "current_A"),
    ("noise", "speed_rad_s"),
    ("runs", 0),
    ("runs", 0, "hottest_degC"),
    ("correlation", "names"),
    ("correlation", "matrix"),
    ("correlation", "matrix", 0),
    ("correlation", "matrix", 0, 0),
]
JSON = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from([0, -1, 10**400, 1e308, -1e-300, float("nan"), float("inf")]),
    st.sampled_from(["", "x", "zoh", "5", "\0"]),
    st.sampled_from([[], {}, [None], [1, 2], {"a": 1}, ["J"]]),
)


def edited(place: tuple[Any, ...], value: object) -> dict[str, Any]:
    """The result with another value in one place."""
    result = copy.deepcopy(RESULT)
    target: Any = result
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    return result


@given(place=st.sampled_from(PLACES), value=JSON)
@settings(max_examples=150, deadline=None)
def test_edited_result_predicts_a_run_or_is_refused(place: tuple[Any, ...], value: object) -> None:
    """Any other exception would reach the user as an internal error."""
    rows, refused = RUN.rows, ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            rows = len(predict(edited(place, value), RUN))
        except IdentificationError as error:
            refused = str(error)

    assert rows == RUN.rows
    assert refused.isprintable()


@given(place=st.sampled_from(PLACES), value=JSON)
@settings(max_examples=200, deadline=None)
def test_edited_result_gives_draws_or_is_refused(place: tuple[Any, ...], value: object) -> None:
    """Draws are used by the feedback, the tuning and the design."""
    drawn, refused = {}, ""
    with np.errstate(all="ignore"):
        try:
            drawn = normal_draws(edited(place, value), 5)
        except InputError as error:
            refused = str(error)

    assert refused.isprintable()
    assert all(values.shape == (5,) for values in drawn.values())
    assert bool(drawn) != bool(refused)


TABLES = {
    **RESULT,
    "errors": {"before": {"training": {"current": {"rmse": 1.0}, "speed": None}}},
    "feedback": [{"temperature_degC": 25.0, "controller": "P:1", "peak": {"median": 1.0}}],
    "warnings": ["a"],
    "warning_details": [{"code": "b"}],
    "effects": [{"name": "c", "equation": "d", "drivers": [], "probability": 1, "parameters": {}}],
}


@given(
    name=st.sampled_from(["parameters", "declared", "effects", "errors", "feedback", "warnings"]),
    member=st.sampled_from(list(TABLES)),
    value=JSON,
)
@settings(max_examples=150, deadline=None)
def test_edited_result_gives_a_table_or_is_refused(
    name: TableName, member: str, value: object
) -> None:
    """One member is replaced; each table needs one or two of them."""
    table, refused = None, ""
    try:
        table = result_table({**TABLES, member: value}, name)
    except InputError as error:
        refused = str(error)

    assert refused.isprintable()
    assert (table is None) == bool(refused)


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("noise", "current_A"), "x", "the noise of the result has the current_A 'x'"),
        (("runs", 0, "hottest_degC"), [], r"a run of the result has the hottest_degC '\[\]'"),
        (("declared", "hold"), "linear", "hold 'linear'; expected zoh or foh"),
    ],
)
def test_message_names_the_edited_value(place: tuple[Any, ...], value: object, words: str) -> None:
    """The expected words are the place and the value that were edited."""
    with pytest.raises(InputError, match=words):
        predict(edited(place, value), RUN)


def test_tuning_refuses_the_same_edited_temperature() -> None:
    """The prediction and the tuning of a motor need the highest temperature that it has had."""
    draws = {name: [value] for name, value in zip(NAMES, SERVO.values, strict=True)}

    with pytest.raises(InputError, match="a run of the result has the hottest_degC 'hot'"):
        motor_of(draws, edited(("runs", 0, "hottest_degC"), "hot"))


def test_runs_without_a_temperature_do_not_count() -> None:
    """Of three runs, one has logged 60 degC; of none, the given temperature holds."""
    runs: list[dict[str, Any]] = [{"hottest_degC": None}, {"hottest_degC": 60}, {}]

    assert hottest_of(runs, 25.0) == 60.0
    assert hottest_of(runs[:1], 25.0) == 25.0
