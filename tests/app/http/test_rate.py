"""The token bucket of a key, against the arithmetic of one."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.http.rate import Bucket


def test_burst_is_let_through_and_the_next_call_waits() -> None:
    """Five at once; at two a second the sixth comes after half a second."""
    bucket = Bucket(rate_per_s=2.0, burst=5, left=5.0, filled=0.0)

    assert [bucket.take(0.0) for _ in range(5)] == [None] * 5
    assert bucket.take(0.0) == pytest.approx(0.5)
    assert bucket.take(0.25) == pytest.approx(0.25)
    assert bucket.take(0.5) is None
    assert bucket.full_in_s == pytest.approx(2.5)


def test_bucket_holds_no_more_than_its_burst() -> None:
    """After a day of silence there are five calls, not 172,800."""
    bucket = Bucket(rate_per_s=2.0, burst=5, left=0.0, filled=0.0)

    assert [bucket.take(86_400.0) is None for _ in range(6)] == [True] * 5 + [False]


@given(
    waits=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=200),
    rate=st.floats(0.1, 50.0),
    burst=st.integers(1, 50),
)
def test_no_span_of_time_sees_more_calls_than_burst_and_rate(
    waits: list[float], rate: float, burst: int
) -> None:
    """From its start to any moment t a token bucket passes at most burst + rate * t calls."""
    bucket = Bucket(rate, burst, float(burst), 0.0)
    now, passed = 0.0, 0
    for wait in waits:
        now += wait
        passed += bucket.take(now) is None

        assert passed <= burst + rate * now + 1e-6


@given(rate=st.floats(0.1, 50.0), burst=st.integers(1, 50))
def test_wait_that_is_told_is_long_enough(rate: float, burst: int) -> None:
    """Whoever waits as long as he is told is let through."""
    bucket = Bucket(rate, burst, 0.0, 0.0)

    wait = bucket.take(0.0)

    assert wait is not None
    assert bucket.take(wait * (1 + 1e-12)) is None
