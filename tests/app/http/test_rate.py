"""Token bucket of a key, compared with its defining inequality."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.http.rate import Bucket


def test_burst_passes_and_the_next_call_waits() -> None:
    """After a burst of five at 2 tokens/s, the sixth call must wait 0.5 s."""
    bucket = Bucket(rate_per_s=2.0, burst=5, left=5.0, filled=0.0)

    assert [bucket.take(0.0) for _ in range(5)] == [None] * 5
    assert bucket.take(0.0) == pytest.approx(0.5)
    assert bucket.take(0.25) == pytest.approx(0.25)
    assert bucket.take(0.5) is None
    assert bucket.full_in_s == pytest.approx(2.5)


def test_bucket_holds_no_more_than_its_burst() -> None:
    """After a day without calls the bucket holds five tokens, not 172,800."""
    bucket = Bucket(rate_per_s=2.0, burst=5, left=0.0, filled=0.0)

    assert [bucket.take(86_400.0) is None for _ in range(6)] == [True] * 5 + [False]


@given(
    waits=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=200),
    rate=st.floats(0.1, 50.0),
    burst=st.integers(1, 50),
)
def test_calls_never_exceed_burst_plus_rate_times_time(
    waits: list[float], rate: float, burst: int
) -> None:
    """In any time t from the start, a token bucket passes at most burst + rate * t calls."""
    bucket = Bucket(rate, burst, float(burst), 0.0)
    now, passed = 0.0, 0
    for wait in waits:
        now += wait
        passed += bucket.take(now) is None

        assert passed <= burst + rate * now + 1e-6


@given(rate=st.floats(0.1, 50.0), burst=st.integers(1, 50))
def test_reported_wait_is_sufficient(rate: float, burst: int) -> None:
    """A call after the reported wait is accepted."""
    bucket = Bucket(rate, burst, 0.0, 0.0)

    wait = bucket.take(0.0)

    assert wait is not None
    assert bucket.take(wait * (1 + 1e-12)) is None
