"""Marks of a device in the lines of a table, rewritten before the table is detected.

10:15:32.100 -> 12.5,0.31           a serial monitor writes the time of arrival in front of
[2026-03-01 10:15:32.100] 12.5,0.31 each line; it becomes the first cell
1,+   12.50,-    0.310              a sign apart from its number, as Graphtec writes it
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace

from identification.ingest.text.blocks import Block

__all__ = ["plain_lines"]

_TIME = rb"(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d\d\.\d{3,6}"
_STAMP = re.compile(rb"^(?:\[(?P<a>%b)\]|(?P<b>%b) -?>) ?" % (_TIME, _TIME), re.M)
_SIGN = re.compile(rb"(^|[,;\t])([+-]) +(?=[\d.])", re.M)


def plain_lines(blocks: Iterator[Block]) -> Iterator[Block]:
    """Rewrite the lines of all blocks if at least half of the first ones have a kind of mark."""
    first = next(blocks)
    lines = [line.encode() for line in first.head if line.strip()]
    stamped, signed = (
        2 * sum(map(bool, map(p.search, lines))) > len(lines) for p in (_STAMP, _SIGN)
    )
    bare = _STAMP.sub(b"", b"\n".join(lines))
    delimiter = next((sign for sign in (b"\t", b";", b",") if bare.count(sign) >= len(lines)), b" ")
    blocks = itertools.chain(iter([first]), blocks)
    del first
    for block in blocks:
        text = block.text
        if stamped:
            text = _STAMP.sub(lambda m: (m["a"] or m["b"]).replace(b" ", b"T") + delimiter, text)
        if signed:
            text = _SIGN.sub(rb"\1\2", text)
        yield replace(block, text=text)
