"""SVG drawings: readable ticks, and lines that break at missing data."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.reporting.figures.corner import corner_figure
from identification.reporting.svg import Frame, path, span, svg, text, tick_words, ticks
from identification.result.report_data import PosteriorChain

FRAME = Frame((10.0, 20.0, 100.0, 50.0), (0.0, 10.0), (-1.0, 1.0))


def test_a_frame_maps_its_corners() -> None:
    """The lower left corner of the data is that of the page, whose y axis points down."""
    assert FRAME.x([0.0, 10.0]).tolist() == [10.0, 110.0]
    assert FRAME.y([-1.0, 1.0]).tolist() == [70.0, 20.0]


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 10))
def test_ticks_are_round_inside_and_neither_few_nor_many(
    low: float, width: float, about: int
) -> None:
    """Steps are 1, 2 or 5 times a power of ten; the number of ticks is close to the request."""
    values = ticks(low, low + width, about)

    assert values.size <= about + 1
    assert values.size >= about / 2.5 - 1
    rounding = 1e-6 * width + 4 * np.spacing(abs(low) + width)
    assert np.all(values >= low - rounding)
    assert np.all(values <= low + width + rounding)
    if values.size > 1:
        step = values[1] - values[0]
        mantissa = step / 10.0 ** np.floor(np.log10(step * 1.0001))
        assert (
            min(abs(mantissa - nice) for nice in (1, 2, 5, 10))
            < 0.01 + 8 * np.spacing(abs(low)) / step
        )


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4))
def test_tick_labels_differ(low: float, width: float) -> None:
    """Equal labels on two ticks would make the axis unreadable."""
    words = [word for _, word in tick_words(low, low + width)]

    assert len(words) == len(set(words)) >= 2


def test_a_line_breaks_where_a_value_is_missing() -> None:
    """Two segments begin with two move commands."""
    drawn = path(np.arange(5.0), np.array([0.0, 0.1, np.nan, 0.2, 0.3]), "line")

    assert drawn.count("M") == 2
    assert "nan" not in drawn


def test_words_are_escaped() -> None:
    """File names in a figure cannot inject markup."""
    drawn = svg(10, 10, "<b>", 'a & "b"', text(1, 1, "<script>"))

    assert "<script>" not in drawn
    assert "&lt;b&gt;" in drawn
    assert "a &amp; " in drawn


@pytest.mark.parametrize("values", [[], [np.nan], [3.0], [0.0, 0.0], [1.0, 2.0]])
def test_a_span_is_never_empty(values: list[float]) -> None:
    """Constant and missing channels also get an axis of positive length."""
    low, high = span(np.array(values))

    assert np.isfinite([low, high]).all()
    assert low < high


def test_a_span_without_margin_ends_with_the_data() -> None:
    """A time axis extends from the first sample to the last."""
    assert span(np.array([2.0, 7.0]), margin=0.0) == (2.0, 7.0)


def test_names_of_many_parameters_do_not_run_into_each_other() -> None:
    """Each name stands in a row of its own, above its panel and right of all panels there."""
    names = ("Ra25", *(f"brush_drop.{n}" for n in ("voltage", "knee", "sharpness")), "noise_speed")
    names += tuple(f"shaft_compliance.{n}" for n in "abcdefgh") + ("noise_current_A",)
    chain = np.random.default_rng(1).standard_normal((30, 8, len(names)))

    drawing = corner_figure(PosteriorChain(names, ("V",) * len(names), chain, 50.0, 1.03))

    places = re.findall(r'class="label strong" x="([\d.]+)" y="([\d.]+)">([^<]*)<', drawing)
    width = float(re.findall(r'viewBox="0 0 ([\d.]+)', drawing)[0])
    assert [words for _, _, words in places] == [f"{name.removesuffix('_A')} [V]" for name in names]
    assert np.all(np.diff([float(y) for _, y, _ in places]) > 20.0)
    assert all(float(x) + 7 * len(words) < width for x, _, words in places)
