"""Sample lines read at once by pandas' C reader, behind checks that make silence impossible.

Every line has as many fields as the first, a blank is no number, and neither is a word.  A block
for which that is not so is declined, not repaired: reading it cell by cell then tells why.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Collection

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.ingest.channels import Channel
from identification.ingest.dialect import Layout

__all__ = ["read_clean"]

Array = NDArray[np.float64]


def read_clean(
    text: bytes,
    layout: Layout,
    channels: tuple[Channel, ...],
    slow: Collection[str],
    decimal: str,
) -> list[Array] | None:
    """Read whole lines that hold nothing but numbers.

    Args:
        text: Lines in UTF-8.
        layout: How the table is written.
        channels: Channels to read.
        slow: Channels whose cells may be blank.
        decimal: Decimal sign.

    Returns:
        For each channel (n_sample,), NaN where a slow channel is blank; or None where the lines
        are not as clean as that.
    """
    bare = _without_quotes(text, layout.delimiter) if b'"' in text else text
    count = text.count(b"\n") + (not text.endswith(b"\n"))
    if bare is None or not _has_expected_delimiters(bare, count, layout):
        return None
    text = bare
    # Where every column is read, the total is enough: a line too long means one too short, and a
    # missing field is a blank, which is no number.
    if (layout.delimiter == " " or len(channels) < layout.fields) and not _has_equal_rows(
        text, count, layout
    ):
        return None
    columns = _parsed(text, layout, channels, {}, decimal)
    blanks = {str(c.column.index): [""] for c in channels if c.name in slow}
    # Looking for blanks costs time, so it is done only where reading without failed.
    if columns is None and blanks and _has_equal_rows(text, count, layout):
        columns = _parsed(text, layout, channels, blanks, decimal)
    if columns is None or columns[0].size != count:
        return None
    return columns if _is_finite(columns, channels, slow) else None


def _without_quotes(text: bytes, delimiter: str) -> bytes | None:
    """The text without quotation marks, where each pair encloses exactly one cell.

    Marks within a cell and delimiters between marks are declined: without the marks they would
    read as something else.
    """
    codes = np.frombuffer(text, dtype=np.uint8)
    quotes = np.flatnonzero(codes == ord('"'))
    if delimiter == " " or quotes.size % 2:
        return None
    opening, closing = quotes[0::2], quotes[1::2]
    edge = np.concatenate(([True], (codes == ord(delimiter)) | (codes == ord("\n")), [True]))
    # `edge` is one sample ahead: its entry k tells about the character before k.
    enclosed = edge[opening] & edge[closing + 2]
    edges = np.cumsum(edge)
    empty_between = edges[opening + 1] == edges[closing + 1]
    return text.replace(b'"', b"") if bool(np.all(enclosed & empty_between)) else None


def _has_expected_delimiters(text: bytes, count: int, layout: Layout) -> bool:
    """Whether the lines have as many delimiters in all as they should have."""
    if layout.delimiter == " ":
        return True
    return text.count(layout.delimiter.encode()) == (layout.fields - 1) * count


def _has_equal_rows(text: bytes, count: int, layout: Layout) -> bool:
    """Whether each line has as many fields as the first sample."""
    codes = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(codes == ord("\n"))
    if ends.size < count:
        ends = np.append(ends, codes.size)
    if layout.delimiter == " ":
        gap = (codes == ord(" ")) | (codes == ord("\t")) | (codes == ord("\n"))
        marks = np.flatnonzero(~gap & np.concatenate(([True], gap[:-1])))
        wanted = layout.fields
    else:
        marks = np.flatnonzero(codes == ord(layout.delimiter))
        wanted = layout.fields - 1
    per_line = np.diff(np.concatenate(([0], np.searchsorted(marks, ends))))
    return bool(np.all(per_line == wanted))


def _parsed(
    text: bytes,
    layout: Layout,
    channels: tuple[Channel, ...],
    blanks: dict[str, list[str]],
    decimal: str,
) -> list[Array] | None:
    used = [str(channel.column.index) for channel in channels]
    try:
        frame = pd.read_csv(
            io.BytesIO(text),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            header=None,
            names=[str(index) for index in range(layout.fields)],
            usecols=used,
            index_col=False,
            dtype=np.float64,
            na_values=blanks,
            keep_default_na=False,
            na_filter=bool(blanks),
            decimal=decimal,
            quoting=csv.QUOTE_NONE,
            encoding_errors="replace",
            engine="c",
            low_memory=False,
        )
    except ValueError:
        return None
    return [np.asarray(frame[index], dtype=np.float64) for index in used]


def _is_finite(columns: list[Array], channels: tuple[Channel, ...], slow: Collection[str]) -> bool:
    """Whether all is finite, but for the blanks of a slow channel."""
    return all(
        not np.any(np.isinf(column)) and (channel.name in slow or not np.any(np.isnan(column)))
        for channel, column in zip(channels, columns, strict=True)
    )
