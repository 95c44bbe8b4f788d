"""Computing time of text patterns on hostile input: at most proportional to its length.

Each text makes a pattern try many matches of the same characters. A text four times as long may
take eight times as long; quadratic patterns took 15 times and cubic ones 60 times.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.commands.arguments import mapping_of
from identification.errors import InputError
from identification.ingest import read_mapping, read_run
from identification.ingest.names import is_units_row, read_header, similar_to
from identification.ingest.text.bare import BareCells, is_affixed, is_grouped
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import expected_instead, is_clock, is_number, split_cells
from identification.ingest.text.interval import stated_interval
from identification.ingest.text.stacked import is_stacked
from identification.ingest.units import find_unit, unit_in_another_case
from tests.ingest.samples import record, write

N = 2500
REPEATED = (" ", "\t", "_", "[", "(", "()", " in", " ,", "aA", "1a", '"', 'a"', "-", "1.1.", "a [ ")
TEXTS = (
    *(f"a{part * N}b" for part in REPEATED),
    "a[" + " " * (N // 3) + "b",
    *(
        "1" + part * N + tail
        for part in (".234", ",", "'234", " ")
        for tail in ("", ",5", " V", "x")
    ),
    *("sampling rate " + part * N for part in ("1", "1.", "1 ", "e")),
    "s" + "\N{COMBINING GRAVE ACCENT BELOW}\N{COMBINING COMMA ABOVE RIGHT}" * N,
)
READERS: dict[str, Callable[[str], object]] = {
    "header": read_header,
    "units row": lambda text: is_units_row([text]),
    "unit": find_unit,
    "unit in another case": unit_in_another_case,
    "similar": lambda text: similar_to(text, "speed"),
    "words": lambda text: split_cells(text, " ", units_in_brackets=True),
    "cells": lambda text: split_cells(text, ","),
    "number": is_number,
    "clock": is_clock,
    "thousands": is_grouped,
    "label or unit": is_affixed,
    "line with labels": BareCells.of(";", ["t:1 s", "U:1 V"]).line,
    "blanks": lambda text: split_cells(text, " "),
    "interval": lambda text: stated_interval([text]),
    "stacked channels": lambda text: is_stacked(Block(f"channel{text}\n1\n2\n3\n".encode(), 1)),
    "no number": lambda text: expected_instead(text, "s"),
    "map": lambda text: mapped("current_A=" + text),
}


def mapped(setting: str) -> None:
    """Read a mapping of the command line and ignore its errors."""
    with contextlib.suppress(InputError):
        mapping_of(None, [setting])


def seconds(read: Callable[[str], object], text: str) -> float:
    """Shortest processor time of three readings [s]."""
    taken = []
    for _ in range(3):
        begun = time.process_time()
        read(text)
        taken.append(time.process_time() - begun)
    return min(taken)


@pytest.mark.parametrize("name", READERS)
def test_time_grows_no_faster_than_the_text(name: str) -> None:
    """A linear pattern takes four times as long; 3 ms allow for the clock resolution."""
    for text in TEXTS:
        short = seconds(READERS[name], text)
        middle = len(text) // 2
        longer = text[:1] + text[1:middle] * 7 + text[middle:]

        assert seconds(READERS[name], longer) < 8.0 * short + 0.003, text[:20]


def seconds_of_refusal(path: Path, cell: str) -> float:
    """Processor time to refuse 8 MB of equal cells of text [s]."""
    path.write_text((",".join([cell] * 300) + "\n") * 260)
    begun = time.process_time()
    with pytest.raises(InputError, match="no line with numbers"):
        read_run(path)
    return time.process_time() - begun


@pytest.mark.parametrize("cell", ["a" + " " * 98 + "b", "aA" * 50, "a[" + " " * 97 + "b"])
def test_table_without_samples_is_refused_in_little_time(tmp_path: Path, cell: str) -> None:
    """Possible header cells take a few times as long as plain words; they once took 20 times."""
    path = tmp_path / "run.csv"
    plain = seconds_of_refusal(path, "a" * 100)

    assert seconds_of_refusal(path, cell) < 5.0 * plain


def test_header_of_many_blanks_at_the_limit_is_read(tmp_path: Path) -> None:
    """An unused column name of 1000 characters does not invalidate the file."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record() | {"a" + " " * 998 + "b": record()["time_s"]}))

    assert read_run(path).rows == 40


def test_mapping_of_many_keys_is_refused_in_little_time(tmp_path: Path) -> None:
    """A comparison in pairs of 70,000 keys (1 MB) took minutes."""
    path = tmp_path / "mapping.json"
    path.write_text(json.dumps({f"k{k}": 0 for k in range(70_000)}))
    begun = time.process_time()

    with pytest.raises(InputError, match="is no channel"):
        read_mapping(path)

    assert time.process_time() - begun < 2.0
