"""Pagination cursors."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import FieldRefused
from app.queries import cursor_of, position_of
from app.tables import RunRow


@given(st.floats(0.0, 1e11), st.from_regex(r"run_[a-z2-7]{26}", fullmatch=True))
def test_cursor_round_trip_is_exact(moment: float, name: str) -> None:
    """Decoding a cursor gives exactly the time and ID of the last entry."""
    rows = [RunRow(id=name, created_at=moment), RunRow(id="run_" + "z" * 26, created_at=0.0)]

    cursor = cursor_of(rows, limit=1)

    assert cursor is not None
    assert position_of(cursor) == (moment, name)


def test_last_page_has_no_cursor() -> None:
    """A page with at most the requested number of entries is the last one."""
    rows = [RunRow(id="run_" + "a" * 26, created_at=1.0)]

    assert cursor_of(rows, limit=1) is None
    assert cursor_of([], limit=1) is None
    assert position_of(None) is None


@given(st.text(max_size=100))
def test_any_text_is_a_position_or_is_refused(text: str) -> None:
    """Decoding an arbitrary text gives a position or a FieldRefused error."""
    try:
        position = position_of(text)
    except FieldRefused:
        return
    assert position is not None


@pytest.mark.parametrize("cursor", ["bmFuIGE", "aW5mIGE", "MHgxcDk5OTkgYQ"])
def test_cursor_with_a_non_finite_time_is_refused(cursor: str) -> None:
    """Databases cannot compare with nan, inf or an overflowing number."""
    with pytest.raises(FieldRefused, match="after: expected the `next`"):
        position_of(cursor)
