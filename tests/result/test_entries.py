"""Entries of result.json, and the schema that the project publishes for it."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator, ValidationError

from identification.result.entries import (
    finite_or_null,
    parameter_entry,
    quantity_entry,
    result_text,
    write_result,
)
from identification.result.schema import result_schema
from tests.reports import make_report

ROOT = Path(__file__).parents[2]
VALIDATOR = Draft202012Validator(result_schema())
NUMBERS = st.floats() | st.integers() | st.none() | st.text() | st.booleans()


@pytest.fixture
def result() -> dict[str, Any]:
    """Modifiable complete result with one effect."""
    made = make_report(rows=300, with_effect=True).result
    copied: dict[str, Any] = copy.deepcopy(dict(made))
    return copied


def test_quantiles_of_normal_draws_are_those_of_the_normal_distribution() -> None:
    """q05 and q95 lie 1.645 standard deviations from the mean, within a sampling error of 0.007."""
    rng = np.random.default_rng(61)

    drawn = quantity_entry(3.0 + 2.0 * rng.standard_normal(100_000), "V")

    closed = {"mean": 3.0, "sd": 2.0, "q05": -0.2898, "median": 3.0, "q95": 6.2898}
    for name, value in closed.items():
        assert drawn[name] == pytest.approx(value, abs=0.05)


def test_draws_that_are_undefined_are_counted_and_left_out() -> None:
    """Three defined draws of four, 1, 2 and 3, have the median 2."""
    entry = quantity_entry([1.0, 2.0, np.nan, 3.0], "s")

    assert entry["median"] == 2.0
    assert entry["defined_fraction"] == 0.75


def test_a_quantity_that_no_draw_has_is_null_throughout() -> None:
    """If the phase never crosses -180 degrees, the gain margin is infinite in every draw."""
    entry = quantity_entry([np.inf, np.inf], "dB")

    assert {entry[name] for name in ("mean", "sd", "q05", "median", "q95")} == {None}
    assert entry["defined_fraction"] == 0.0


def test_identified_is_a_plain_boolean() -> None:
    """JSON cannot encode a NumPy boolean."""
    entry = parameter_entry(np.ones(3), "ohm", np.bool_(True))  # type: ignore[arg-type]

    assert json.loads(json.dumps(entry))["identified"] is True


@given(st.recursive(NUMBERS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_anything_becomes_json_without_nan(value: object) -> None:
    """The strict encoder accepts any converted value; it rejects NaN and infinity."""
    json.dumps(finite_or_null(value), allow_nan=False)


def test_numbers_of_numpy_become_plain_ones() -> None:
    """Arrays, scalars and NaN are converted at any depth."""
    value = {"a": np.array([1.0, np.nan]), "b": (np.int64(3), np.float64("inf")), "c": np.bool_(1)}

    assert finite_or_null(value) == {"a": [1.0, None], "b": [3, None], "c": True}


def test_a_written_result_reads_back_in_full_precision(
    result: dict[str, Any], tmp_path: Path
) -> None:
    """Python writes the shortest text that reads back as the same float."""
    write_result(tmp_path / "result.json", result)

    assert json.loads((tmp_path / "result.json").read_text("utf-8")) == finite_or_null(result)


def test_schema_is_itself_valid_and_names_no_host() -> None:
    """The schema conforms to the 2020-12 meta-schema; its id is no URL that a tool would fetch."""
    Draft202012Validator.check_schema(result_schema())

    assert result_schema()["$id"] == "urn:motorid:result:1"


def test_a_complete_result_is_valid(result: dict[str, Any]) -> None:
    """The synthetic result conforms to the schema."""
    VALIDATOR.validate(json.loads(result_text(result)))


def test_null_for_unknown_parts_and_additional_members_are_valid(result: dict[str, Any]) -> None:
    """The contract specifies null for unknown values and permits additional members."""
    result["sampler"] = None
    result["errors"]["after"]["validation"] = None
    result["noise"]["current_A"] = None
    result["effects"] = []
    result["more"] = {"than": "before"}
    result["feedback"][0]["statement"] = "stable"

    VALIDATOR.validate(result)


def _without(path: str) -> Callable[[Any], None]:
    def change(result: Any) -> None:
        *parents, last = path.split("/")
        for name in parents:
            result = result[int(name)] if name.isdigit() else result[name]
        del result[last]

    return change


def _with(path: str, value: object) -> Callable[[Any], None]:
    def change(result: Any) -> None:
        *parents, last = path.split("/")
        for name in parents:
            result = result[int(name)] if name.isdigit() else result[name]
        result[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_without("noise"), "'noise' is a required"),
        (_without("parameters/Ra25"), "'Ra25' is a required"),
        (_without("declared/parameters/L"), "'L' is a required"),
        (_without("parameters/J/identified"), "'identified' is a required"),
        (_without("feedback/0/rise_time_s/q95"), "'q95' is a required"),
        (_without("errors/before/training/speed/noise_ratio"), "'noise_ratio' is a required"),
        (_without("effects/0/alternatives"), "'alternatives' is a required"),
        (_with("schema_version", 2), "1 was expected"),
        (_with("parameters/Kt25/unit", "mN m/A"), "'N m/A' was expected"),
        (_with("parameters/Kt25/median", "0.07"), "is not of type"),
        (_with("runs/0/role", "test"), "is not one of"),
        (_with("runs/0/sha256", "abc"), "does not match"),
        (_with("effects/0/name", "magic"), "is not one of"),
        (_with("effects/0/equation", "optical"), "is not one of"),
        (_with("effects/0/drivers", ["torque"]), "is not one of"),
        (_with("effects/0/probability", 1.2), "greater than the maximum"),
        (_with("noise/speed_rad_s", -1.0), "less than the minimum"),
        (_with("warnings", [{"text": "no"}]), "is not of type"),
    ],
)
def test_a_result_that_breaks_the_contract_is_refused(
    result: dict[str, Any], change: Callable[[Any], None], message: str
) -> None:
    """Each single violation of the contract is rejected."""
    change(result)

    with pytest.raises(ValidationError, match=message):
        VALIDATOR.validate(result)


def _properties(schema: object) -> Iterator[str]:
    """Names of all members in a schema."""
    if isinstance(schema, dict):
        for key, value in schema.items():
            if key == "properties":
                yield from value
            yield from _properties(value)
    elif isinstance(schema, list):
        for item in schema:
            yield from _properties(item)


def test_the_page_about_the_result_explains_every_member() -> None:
    """docs/result-json.md names each member of the schema as code."""
    page = (ROOT / "docs/result-json.md").read_text("utf-8")
    explained = set(re.findall(r"`([\w.]+)`", page))
    spoken = {word for name in explained for word in name.split(".")}

    assert set(_properties(result_schema())) - spoken == set()
