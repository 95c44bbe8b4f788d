"""Mutations of files: bits, cuts, splices, numbers, encodings."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

from tests.ingest.samples import Dialect, record, write

__all__ = ["SAMPLES", "mutated"]

_RECORD = record(rows=40)
_RENAMED = dict(
    zip(("t [ms]", "U (V)", "i in mA", "n/rpm", "Temp °C"), _RECORD.values(), strict=True)
)

SAMPLES: dict[str, bytes] = {
    "canonical CSV": write(_RECORD),
    "semicolons and decimal commas": write(_RENAMED, Dialect(delimiter=";", decimal=",")),
    "tabs in UTF-16": write(_RENAMED, Dialect(delimiter="\t", encoding="utf-16")),
    "quotes and a units row": write(
        {"time": _RECORD["time_s"], **{n: _RECORD[n] for n in list(_RECORD)[1:]}},
        Dialect(quote='"', newline="\r\n"),
        units=["s", "V", "A", "rad/s", "degC"],
    ),
    "lines above the header": write(
        _RECORD,
        Dialect(above=("Model,X1", "", "# bench 3", "Points,40"), encoding="utf-8-sig"),
    ),
}
"""A valid file in each format that the reader distinguishes."""

_NUMBER = re.compile(rb"-?\d+(?:[.,]\d+)?")
_HUGE = (
    b"1e999", b"-1e308", b"9" * 400, b"0x1F", b"nan", b"inf", b"-", b"1e", b"1_0", b"1,2,3", b"--1",
    b"1e-400", b"\xd9\xa1\xd9\xa2", b"=1+1", b"1.7976931348623157e308", b"00", b"1 2", b"''", b'"',
)  # fmt: skip
_TEXTS = (
    b"\0", b"\r", b"\n", b"\r\n", b"\n\n", b'"', b"'", b",", b";", b"\t", b"\xff", b"\xfe\xff",
    b"\xef\xbb\xbf", b"\x1a", b"#", b"\\", b"%s", b"\xe2\x80\xae", b"\xc2\x85", b"\xe2\x80\xa8",
    b"\xed\xa0\x80", b"rpm", b"degF", b"[kV]", b"time_s", b"-- ", b"=cmd|", b"\x1b[2J",
)  # fmt: skip
_CODECS = ("utf-16-le", "utf-16-be", "utf-32", "latin-1", "cp037", "utf-7", "utf-8-sig", "cp1252")


def _bits(content: bytearray, chance: random.Random) -> bytes:
    for _ in range(chance.choice((1, 1, 2, 3, 20))):
        if content:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    return bytes(content)


def _cut(content: bytearray, chance: random.Random) -> bytes:
    start, end = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    return bytes(content[start:end] if chance.random() < 0.5 else content[:start] + content[end:])


def _spliced(content: bytearray, chance: random.Random) -> bytes:
    other = chance.choice(list(SAMPLES.values()))
    at, start, end = (chance.randrange(len(c) + 1) for c in (content, other, other))
    return bytes(content[:at]) + other[min(start, end) : max(start, end)] + bytes(content[at:])


def _repeated(content: bytearray, chance: random.Random) -> bytes:
    start, end = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    part = bytes(content[start:end])[:2000]
    return bytes(content[:end]) + part * chance.randint(1, 200) + bytes(content[end:])


def _numbers(content: bytearray, chance: random.Random) -> bytes:
    share = chance.choice((0.002, 0.05, 1.0))
    word = chance.choice(_HUGE)
    return _NUMBER.sub(lambda m: word if chance.random() < share else m.group(), bytes(content))


def _inserted(content: bytearray, chance: random.Random) -> bytes:
    for _ in range(chance.randint(1, 5)):
        at = chance.randrange(len(content) + 1)
        content[at:at] = chance.choice(_TEXTS) * chance.choice((1, 1, 1, 50))
    return bytes(content)


def _recoded(content: bytearray, chance: random.Random) -> bytes:
    text = bytes(content).decode("utf-8", "replace")
    return text.encode(chance.choice(_CODECS), "replace")


def _lines(content: bytearray, chance: random.Random) -> bytes:
    lines = bytes(content).split(b"\n")
    match chance.randrange(4):
        case 0:
            chance.shuffle(lines)
        case 1:
            lines = [line[: chance.randrange(len(line) + 1)] for line in lines]
        case 2:
            lines = lines[:1] + lines[1:] * chance.randint(2, 50)
        case _:
            lines.insert(chance.randrange(len(lines)), lines[0])
    return b"\n".join(lines)


_KINDS: Sequence[Callable[[bytearray, random.Random], bytes]] = (
    _bits, _cut, _spliced, _repeated, _numbers, _inserted, _recoded, _lines,
)  # fmt: skip


def mutated(content: bytes, chance: random.Random) -> bytes:
    """Apply one to three random mutations."""
    for _ in range(chance.choice((1, 1, 2, 3))):
        content = chance.choice(_KINDS)(bytearray(content), chance)
    return content
