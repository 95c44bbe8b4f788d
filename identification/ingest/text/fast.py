"""Fast path: parse a block of sample lines with the C reader of pandas, after strict checks.

Every line must have the expected number of fields, and every cell must be a number or blank, and
the time a number.  A block that fails a check is declined and not
repaired; `SampleReader` then reads it cell by cell and reports the fault.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

import numpy as np
import pandas as pd

from identification.arrays import Array
from identification.ingest.channels import Channel
from identification.ingest.text.cells import ClockTimes, LongTimes
from identification.ingest.text.dialect import Layout

__all__ = ["read_clean", "read_times"]


def read_clean(
    text: bytes, layout: Layout, channels: Sequence[Channel], decimal: str
) -> list[Array] | None:
    """Parse whole lines that contain nothing but numbers.

    Return (n_sample,) for each channel, NaN at a blank cell; or None if the block fails a check.
    """
    bare = _without_quotes(text, layout.delimiter) if b'"' in text else text
    if bare is None:
        return None
    text, count = bare, bare.count(b"\n") + (not bare.endswith(b"\n"))
    delimiters = (layout.fields - 1) * count
    if layout.delimiter != " " and text.count(layout.delimiter.encode()) != delimiters:
        return None
    # If every column is read, the total count suffices: a line with too many fields implies one
    # with too few, and a missing field is a blank, which is not a number.
    if (layout.delimiter == " " or len(channels) < layout.fields) and not _has_equal_rows(
        text, count, layout
    ):
        return None
    columns = _parsed(text, layout, channels, {}, decimal)
    blanks = {str(c.column.index): [""] for c in channels if c.may_lack}
    # Blank handling is slow, so it is tried only after parsing without it has failed.
    if columns is None and blanks and _has_equal_rows(text, count, layout):
        columns = _parsed(text, layout, channels, blanks, decimal)
    if columns is None or columns[0].size != count:
        return None
    if any(map(np.any, map(np.isinf, columns))) or np.any(np.all(np.isnan(columns), axis=0)):
        return None
    return columns


def read_times(
    text: bytes, layout: Layout, time: Channel, clock: ClockTimes | LongTimes
) -> Array | None:
    """Times (n_sample,) of whole lines by their reader; None if the lines fail a check."""
    if b'"' in text or layout.delimiter == " ":
        return None
    at, delimiter = time.column.index, layout.delimiter.encode()
    lines = text.removesuffix(b"\n").split(b"\n")
    cells = (
        b"".join(line.split(delimiter)[at : at + 1]).decode("utf-8", "replace") for line in lines
    )
    blank = np.nan if time.may_end else None
    times = [clock.seconds(cell) if (cell := one.strip()) else blank for one in cells]
    return None if None in times else np.array(times, dtype=np.float64)


def _without_quotes(text: bytes, delimiter: str) -> bytes | None:
    """Text without quotation marks if each pair encloses exactly one cell, else None.

    Marks within a cell and delimiters between marks are declined, because the text would parse
    differently without the marks.
    """
    codes = np.frombuffer(text, dtype=np.uint8)
    quotes = np.flatnonzero(codes == ord('"'))
    if delimiter == " " or quotes.size % 2:
        return None
    opening, closing = quotes[0::2], quotes[1::2]
    edge = np.concatenate(([True], (codes == ord(delimiter)) | (codes == ord("\n")), [True]))
    # `edge` is shifted by one: entry k describes the character before k.
    enclosed = edge[opening] & edge[closing + 2]
    edges = np.cumsum(edge)
    empty_between = edges[opening + 1] == edges[closing + 1]
    return text.replace(b'"', b"") if bool(np.all(enclosed & empty_between)) else None


def _has_equal_rows(text: bytes, count: int, layout: Layout) -> bool:
    """Return True if every line has as many fields as the first sample."""
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
    channels: Sequence[Channel],
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
