"""Positions in a list."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import FieldRefused
from app.queries import cursor_of, position_of


@dataclass(frozen=True)
class Entry:
    """An entry of a list."""

    id: str
    created_at: float


@given(st.floats(0.0, 1e11), st.from_regex(r"run_[a-z2-7]{26}", fullmatch=True))
def test_cursor_is_the_last_entry_of_its_page_to_the_last_bit(moment: float, name: str) -> None:
    """Reading a cursor back gives exactly the time and id it was made of."""
    rows = [Entry(name, moment), Entry("run_" + "z" * 26, 0.0)]

    cursor = cursor_of(rows, limit=1)

    assert cursor is not None
    assert position_of(cursor) == (moment, name)


def test_last_page_has_no_cursor() -> None:
    """As many entries as the page holds, or fewer."""
    rows = [Entry("run_" + "a" * 26, 1.0)]

    assert cursor_of(rows, limit=1) is None
    assert cursor_of([], limit=1) is None
    assert position_of(None) is None


@given(st.text(max_size=100))
def test_text_that_is_no_cursor_is_refused_and_never_crashes(text: str) -> None:
    """Any text is a position or a named error."""
    try:
        position = position_of(text)
    except FieldRefused:
        return
    assert position is not None


@pytest.mark.parametrize("cursor", ["bmFuIGE", "aW5mIGE", "MHgxcDk5OTkgYQ"])
def test_position_at_no_time_is_refused(cursor: str) -> None:
    """nan, inf and 0x1p9999 in base 64: no database compares with them."""
    with pytest.raises(FieldRefused, match="after: expected the `next`"):
        position_of(cursor)
