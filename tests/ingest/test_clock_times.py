"""Times of day as seconds."""

from __future__ import annotations

import pytest

from identification.ingest.text.cells import ClockTimes


@pytest.mark.parametrize(
    ("first", "second", "seconds"),
    [
        ("08:00:00", "08:00:00.000000001", 1e-9),
        ("23:59:59.5", "00:00:00.25", 0.75),
        ("2026-02-28T23:59:59Z", "2026-03-01T00:00:01Z", 2.0),
        ("2026-03-29T01:59:59+01:00", "2026-03-29T03:00:00+02:00", 1.0),
        ("28.02.2024 23:59:59,9", "01.03.2024 00:00:00,0", 86400.1),
        ("2026/03/01 08:00:00", "2026/03/01 09:00:00", 3600.0),
        ("11:59:59 AM", "12:00:01 PM", 2.0),
        ("12:59:59.5 AM", "1:00:00 AM", 0.5),
        ("59:59.5", "01:00:00.5", 1.0),
    ],
)
def test_difference_of_two_times_of_day(first: str, second: str, seconds: float) -> None:
    """By hand: midnight, a leap year, the change to summer time in UTC."""
    clock = ClockTimes()

    assert clock.seconds(first) == 0.0
    assert clock.seconds(second) == seconds


@pytest.mark.parametrize("cell", ["", "0.5", "2026-03-01", "2026-02-30T08:00:00", "8 o'clock"])
def test_other_cells_are_no_times_of_day(cell: str) -> None:
    """A date alone, a day that does not exist, a number."""
    assert ClockTimes().seconds(cell) is None


def test_date_of_unknown_order_must_not_change() -> None:
    """03/01 may be in January or in March."""
    clock = ClockTimes()

    assert clock.seconds("03/01/2026 08:00:00") == 0.0
    assert clock.seconds("03/01/2026 08:00:01") == 1.0
    assert clock.seconds("04/01/2026 08:00:00") is None
