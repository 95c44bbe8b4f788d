"""Reports of implausible values: each part shows them or states why it cannot."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from identification.diagnosis.residual import Correlation
from identification.reporting import files
from identification.reporting.figures.corner import corner_figure
from identification.reporting.figures.curves import (
    coefficient_figure,
    correlation_figure,
    missing_over_time,
    missing_term_figure,
    step_figure,
    trace_figure,
)
from identification.reporting.html import render_report
from identification.result.attempts import figure
from identification.result.entries import result_text
from identification.result.numbers import (
    interval_text,
    number_text,
    percent_text,
    probability_text,
    scaled_unit,
    signed_percent_text,
    unit_power,
)
from identification.result.report_data import (
    CoefficientCurve,
    MissingTerm,
    MissingTrace,
    PosteriorChain,
    RunTraces,
)
from identification.speed_loop import StepCurve
from tests.reports import make_report

Array = NDArray[np.float64]

SPECIAL = [0.0, -0.0, 5e-324, -1e-310, 1e-300, 1e300, -1.7e308, np.nan, np.inf, -np.inf]
NUMBERS = st.one_of(st.sampled_from(SPECIAL), st.floats(), st.integers(-(10**400), 10**400))
SERIES = arrays.arrays(
    np.float64, 12, elements=st.one_of(st.sampled_from(SPECIAL), st.floats(-10, 10))
)
TIME = np.arange(12.0)


@given(NUMBERS, NUMBERS, NUMBERS)
def test_any_number_is_written_in_few_characters(one: float, two: float, three: float) -> None:
    """Any number becomes a dash or at most 24 characters: sign, digits and power of ten."""
    texts = [number_text(one), percent_text(one), probability_text(one), signed_percent_text(one)]
    written = interval_text(one, two, three)
    texts += [written.median, written.low, written.high, scaled_unit("N m", unit_power(one))]

    assert all(0 < len(text) <= 24 for text in texts)
    assert not any("nan" in text or "inf" in text for text in texts)


def _term(driver: Array, estimate: Array, curve: tuple[Array, ...], effect: str) -> MissingTerm:
    words = ("mechanical", "torque", "N m", "speed", "rad/s")
    if not curve:
        return MissingTerm(*words, driver, estimate)
    grid, median, low, high = curve
    return MissingTerm(*words, driver, estimate, grid, median, low, high, effect)


def _run(a: Array, b: Array, c: Array) -> RunTraces:
    return RunTraces("r.csv", "training", TIME, a, b, a, b, c, a, b, c)


FIGURES: dict[str, Callable[[Array, Array, Array], str]] = {
    "corner": lambda a, b, c: corner_figure(_chain(a, b)),
    "trace": lambda a, b, c: trace_figure(_chain(a, b), 0),
    "correlation": lambda a, b, c: correlation_figure(
        "residual", _correlation(a, b), _correlation(c, b)
    ),
    "coefficient": lambda a, b, c: coefficient_figure(
        CoefficientCurve("Ra", "ohm", a, b, c, a, before=b), [c]
    ),
    "steps": lambda a, b, c: step_figure([StepCurve(25.0, "P:1", TIME, a, b, c, a)]),
    "missing": lambda a, b, c: missing_term_figure(_term(a, b, (c, a, b, c), "drag")),
    "unlisted": lambda a, b, c: missing_term_figure(_term(a, b, (), "")),
    "over time": lambda a, b, c: missing_over_time(
        MissingTrace("r.csv", "torque", "N m", TIME, a, b, c, fitted=a, effect="drag")
    ),
}


def _correlation(values: Array, width: Array) -> Correlation:
    return Correlation(np.arange(1, values.size + 1), values, np.abs(width), 0.99)


def _chain(a: Array, b: Array) -> PosteriorChain:
    walks = np.stack([a, b], axis=1).reshape(-1, 2, 2)
    return PosteriorChain(("p", "q"), ("1", "N m"), walks, 50.0, 1.03)


@pytest.mark.parametrize("name", FIGURES)
@settings(deadline=None, max_examples=60)
@given(SERIES, SERIES, SERIES)
def test_each_figure_is_a_drawing_or_a_line_of_text(
    name: str, one: Array, two: Array, three: Array
) -> None:
    """No coordinate is NaN or infinite, and 12 samples take a few kilobytes at most."""
    drawn = str(figure(name, FIGURES[name], one, two, three))

    assert drawn.startswith(("<svg", '<div class="chart"', '<p class="muted">'))
    assert len(drawn) < 60_000
    assert not re.search(r'[ "MVHZ](nan|-?inf)', "".join(re.findall(r' (?:d|x|y)="[^"]*"', drawn)))
    assert not re.search("NaN|Infinity", drawn)


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("value", [0.0, 5e-324, 1.0, 1e300, np.nan])
def test_each_figure_of_one_value_is_a_drawing_or_a_line_of_text(name: str, value: float) -> None:
    """Constant channels, as of a motor at rest, and constant draws give a figure or a text."""
    same = np.full(12, value)

    drawn = str(figure(name, FIGURES[name], same, same, same))

    assert drawn.startswith(("<svg", '<div class="chart"', '<p class="muted">'))


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_of_nothing_is_a_drawing_or_a_line_of_text(name: str) -> None:
    """Empty curves, as of an effect without samples in its range, give a figure or a text."""
    empty = np.zeros(0)

    assert str(figure(name, FIGURES[name], empty, empty, empty))


def _spoilt(value: Any, number: Any) -> Any:
    """Copy of a JSON structure with each floating-point number replaced."""
    if isinstance(value, dict):
        return {k: v if k in ("rows", "same_as") else _spoilt(v, number) for k, v in value.items()}
    if isinstance(value, list):
        return [_spoilt(item, number) for item in value]
    return number if isinstance(value, float) else value


@pytest.mark.parametrize("number", [None, 0.0, 5e-324, 1e300, -1.0, np.nan, -np.inf])
@pytest.mark.parametrize("with_effect", [False, True])
def test_a_page_is_complete_with_any_number_in_the_result(
    number: float | None, with_effect: bool
) -> None:
    """With every float of result.json replaced, the page is complete and its JSON is valid."""
    data = make_report(with_effect=with_effect)
    result = _spoilt(dict(data.result), number)

    page = render_report(replace(data, result=result))

    assert page.rstrip().endswith("</html>")
    json.loads(result_text(result), parse_constant=lambda word: pytest.fail(word))


@settings(deadline=None, max_examples=10)
@given(one=SERIES, two=SERIES, three=SERIES)
def test_a_page_is_complete_with_any_run(one: Array, two: Array, three: Array) -> None:
    """The page is complete for a run that diverges and for a motor at rest."""
    page = render_report(replace(make_report(), runs=(_run(one, two, three),)))

    assert page.rstrip().endswith("</html>")


def test_a_figure_that_fails_is_replaced_by_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reason is escaped, because it may contain a file name."""

    def fails() -> str:
        raise ValueError("cannot convert <NaN>")

    drawn = figure("step response", fails)

    assert "The step response cannot be drawn" in drawn
    assert "cannot convert &lt;NaN&gt;" in drawn


def test_a_part_that_fails_leaves_its_remark_on_the_page() -> None:
    """Without `errors` in the result, a remark replaces their table and the figures are shown."""
    data = make_report()
    broken = {name: value for name, value in data.result.items() if name != "errors"}

    page = render_report(replace(data, result=broken))

    assert "The table of errors cannot be drawn" in page
    assert "Step responses with" in page


def test_a_failed_page_keeps_the_result_and_removes_the_old_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """result.json is written first, so a page that fails loses no numbers."""

    def fails(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr(files, "report_data", fails)
    (tmp_path / "report.html").write_text("of another fit", encoding="utf-8")

    with pytest.raises(MemoryError):
        files.write_outputs(
            tmp_path, {"schema_version": 1}, cast(Any, SimpleNamespace(sample=None))
        )

    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]
