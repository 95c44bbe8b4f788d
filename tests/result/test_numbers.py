"""Numbers as an engineer writes them."""

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
    unit_text,
)


def test_an_interval_has_two_digits_of_its_standard_deviation() -> None:
    """A 90 % interval of a normal law is 3.29 standard deviations wide: 0.00050 here."""
    written = interval_text(0.590343, 0.589513, 0.591173)

    assert (written.median, written.low, written.high, written.power) == (
        "0.59034",
        "0.58951",
        "0.59117",
        "",
    )


def test_a_small_quantity_is_written_with_one_power_for_all_three() -> None:
    """42 millionths of kg m^2 with an interval of one per cent."""
    written = interval_text(4.2131e-5, 4.201e-5, 4.226e-5)

    assert (written.median, written.power) == ("4.2131", " ×10⁻⁵")


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
    """Rounding by hand; an en dash for what is unknown."""
    assert number_text(value, digits) == expected


def test_what_is_unknown_or_zero_is_written_as_such() -> None:
    """Null becomes an en dash, a metric that is zero in all draws becomes a plain 0."""
    assert interval_text(None, None, None).median == "–"
    assert interval_text(0.0, 0.0, 0.0).median == "0"
    assert interval_text(1.5, None, None).low == "–"


def test_a_probability_is_never_written_as_a_certainty_it_is_not() -> None:
    """0.9999 rounds to 100.0 %, which would be a claim of certainty."""
    assert probability_text(0.9999) == "> 99.9 %"
    assert probability_text(0.0002) == "< 0.1 %"
    assert probability_text(1.0) == "100.0 %"
    assert probability_text(None) == "–"


def test_changes_carry_their_sign() -> None:
    """Two digits at least, a true minus."""
    assert signed_percent_text(-0.76) == "−76 %"
    assert signed_percent_text(0.0123) == "+1.2 %"
    assert signed_percent_text(None) == "–"


def test_units_get_their_signs_and_unknown_ones_stay() -> None:
    """Spellings of the contract on the left."""
    assert unit_text("kg m^2") == "kg·m²"
    assert unit_text("ohm") == "Ω"
    assert unit_text("furlong") == "furlong"
    assert scaled_unit("H", -4) == "10⁻⁴ H"
    assert (unit_power(5.1e-4), unit_power(0.6), unit_power(0.0)) == (-4, 0, 0)


def test_shares_and_counts_are_written_for_the_eye() -> None:
    """Per cent with the digits asked for, thousands apart."""
    assert percent_text(0.998) == "99.8 %"
    assert count_text(120_000) == "120\u202f000"
    assert count_text(None) == "–"


def test_a_number_whose_power_of_ten_has_no_inverse_is_written_too() -> None:
    """Of 1e-320 nothing is left in four digits of 1e-300."""
    assert number_text(1e-320).startswith("0.000")
    assert interval_text(1e-320, 0.0, 2e-320).median.startswith("0.000")
