"""Number formats of the report: significant digits, powers of ten and units."""

from __future__ import annotations

import pytest

from identification.result.numbers import (
    count_text,
    interval_text,
    number_text,
    percent_text,
    probability_text,
    scaled_unit,
    signed_percent_text,
    unit_power,
    unit_prefix,
    unit_text,
)


@pytest.mark.parametrize(
    ("deviation", "decimals"), [(0.03, 3), (0.0354, 3), (0.0356, 2), (0.09, 2), (0.098, 2)]
)
def test_an_interval_has_the_digits_of_its_standard_deviation(
    deviation: float, decimals: int
) -> None:
    """A 90 % interval is 3.29 deviations wide; the rule of the Particle Data Group gives digits."""
    written = interval_text(0.59, 0.59 - 1.645 * deviation, 0.59 + 1.645 * deviation)

    assert {len(text.partition(".")[2]) for text in (written.median, written.low)} == {decimals}


def test_the_ends_of_an_interval_have_the_decimals_of_the_median() -> None:
    """A width of 0.00166 is 3.29 deviations of 0.0005, which has one digit."""
    written = interval_text(0.590343, 0.589513, 0.591173)

    assert (written.median, written.low, written.high) == ("0.5903", "0.5895", "0.5912")


def test_an_interval_over_decades_keeps_its_median() -> None:
    """A median of 0.0021 in an interval up to 36 is not zero: each number has its own power."""
    written = interval_text(0.0021, 1.3e-7, 36.0)

    assert (written.median, written.low, written.high) == ("0.0021", "1.3 ×10⁻⁷", "36")


@pytest.mark.parametrize(
    ("values", "factor", "unit"),
    [
        ((0.00212, 0.0031), 1e3, "ms"),
        ((2e-6, None), 1e6, "µs"),
        ((0.4, 1.2), 1.0, "s"),
        ((None,), 1.0, "s"),
        ((0.0,), 1.0, "s"),
    ],
)
def test_short_times_get_a_prefix(
    values: tuple[float | None, ...], factor: float, unit: str
) -> None:
    """The largest value of a row is written with one to three digits before the point."""
    assert unit_prefix("s", values) == (factor, unit)
    assert unit_prefix("N m", values) == (1.0, "N m")


def test_a_small_quantity_is_written_with_one_power_for_all_three() -> None:
    """42e-6 kg m^2 and both ends of its interval share one power of ten."""
    written = interval_text(4.2131e-5, 4.201e-5, 4.226e-5)

    assert (written.median, written.power) == ("4.213", " ×10⁻⁵")


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (0.71931, 4, "0.7193"),
        (1234.5, 4, "1234"),
        (-3e-7, 2, "−3.0 ×10⁻⁷"),
        (2.5e8, 2, "2.5 ×10⁸"),
        (0.0, 3, "0.00"),
        (None, 4, "–"),
        (float("nan"), 4, "–"),
        (float("inf"), 4, "–"),
    ],
)
def test_a_number_is_written_to_its_digits(value: float | None, digits: int, expected: str) -> None:
    """Numbers are rounded to the given digits; an unknown number is an en dash."""
    assert number_text(value, digits) == expected


def test_what_is_unknown_or_zero_is_written_as_such() -> None:
    """Null becomes an en dash; a metric that is zero in all draws becomes 0."""
    assert interval_text(None, None, None).median == "–"
    assert interval_text(0.0, 0.0, 0.0).median == "0"
    assert interval_text(1.5, None, None).low == "–"


def test_a_rounded_probability_is_not_written_as_a_certainty() -> None:
    """0.9999 would round to 100.0 % and is written as > 99.9 %."""
    assert probability_text(0.9999) == "> 99.9 %"
    assert probability_text(0.0002) == "< 0.1 %"
    assert probability_text(1.0) == "> 99.9 %"
    assert probability_text(0.0) == "< 0.1 %"
    assert probability_text(None) == "–"


def test_changes_carry_their_sign() -> None:
    """A change has a sign and at least two digits, with a true minus."""
    assert signed_percent_text(-0.76) == "−76 %"
    assert signed_percent_text(0.0123) == "+1.2 %"
    assert signed_percent_text(-0.99654) == "−99.65 %"
    assert signed_percent_text(-1.0) == "−100 %"
    assert signed_percent_text(-1e-5) == signed_percent_text(1e-5) == "0.00 %"
    assert signed_percent_text(None) == "–"


def test_units_get_their_signs_and_unknown_ones_stay() -> None:
    """Units of the contract become symbols; an unknown unit is left unchanged."""
    assert unit_text("kg m^2") == "kg·m²"
    assert unit_text("ohm") == "Ω"
    assert unit_text("furlong") == "furlong"
    assert scaled_unit("H", -4) == "10⁻⁴ H"
    assert (unit_power(5.1e-4), unit_power(0.6), unit_power(0.0)) == (-4, 0, 0)


def test_shares_are_percentages_and_counts_have_separators() -> None:
    """A share is a percentage; a count has thousands separators."""
    assert percent_text(0.998) == "99.8 %"
    assert count_text(120_000) == "120\u202f000"
    assert count_text(None) == "–"


def test_a_number_whose_power_of_ten_has_no_inverse_is_written_too() -> None:
    """10^320 overflows, so a denormal number such as 1e-320 is written with 1e-300."""
    assert number_text(1e-320).startswith("0.000")
    assert interval_text(1e-320, 0.0, 2e-320).median.startswith("0.000")
