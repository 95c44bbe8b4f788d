"""Dialect detection for text tables: delimiter, header rows and first sample line.

The samples determine the dialect.  A line counts as a sample if its first cell is blank, a number,
a clock time or the text in front of most lines, and at least two and more than half of its filled
cells are numbers.  Each candidate delimiter is scored by the summed fraction of numeric cells over
the sample lines with the most frequent number of cells; the highest score wins.  Numbers with
labels or units (`bare`) count where hardly any line has plain ones.  The header rows are the lines
directly above the first sample with the same number of cells; title lines of an oscilloscope or a
logger above them are skipped.  Below the first line of names no line is skipped: a line that
contains numbers between names and samples is a damaged sample and raises an error.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

from identification.errors import EmptyFile, FileTooLarge, NoRows, NoTable, NotANumber, RunFileError
from identification.ingest.display import listed, quoted
from identification.ingest.file import Limits
from identification.ingest.names import is_channel_name
from identification.ingest.text.bare import BareCells, is_affixed, is_grouped
from identification.ingest.text.blocks import Block
from identification.ingest.text.cells import (
    is_clock,
    is_number,
    is_number_word,
    is_time_of_day,
    split_cells,
)
from identification.ingest.text.header import HeaderRows, Line, Preamble, keyed_rows, read_preamble
from identification.ingest.text.interval import stated_interval
from identification.ingest.text.labelled import TRACE

__all__ = ["COMMENT_MARKS", "Layout", "detect_layout"]

# TwinCAT ends a file with EOF.
COMMENT_MARKS = ("#", "%", "//", "EOF")

_PREVIEW_LINES = 1000
# Limit of the search for a header in a text without samples.
_SEARCHED_CHARACTERS = 100_000
_NUMBERS = re.compile(r"\d+(?:[.,]\d+)?")
_SHOWN = 1000
# Order of preference if two delimiters have the same score.
_DELIMITERS = ("\t", ";", ",", " ")
_MAYBE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class Layout:
    """Layout of the table in one file."""

    delimiter: str
    """One character; a space stands for one or more blanks and tabs."""
    fields: int
    """Number of cells of each sample line, including an empty last one."""
    header: tuple[tuple[str, ...], ...]
    """Header rows from top to bottom, each with `fields` cells."""
    header_line: int
    """Line number of the first header row."""
    first_line: int
    """Line number of the first sample."""
    preamble: Preamble = Preamble()
    """Lines of a device above the header."""
    sample: tuple[str, ...] = ()
    """Cells of the first sample."""
    first_field: int = 0
    """Index of the first cell of a sample; the cells left of it are settings."""
    bare: BareCells | None = None
    """Rewriting of lines whose cells are no plain numbers, or None."""


def detect_layout(block: Block, limits: Limits) -> Layout:
    """Detect the layout from the first block of a file.

    Raises:
        FileTooLarge: The table has more columns than the limit.
        RunFileError: The block holds no samples, no header or no unambiguous decimal sign.
    """
    lines, comments, forced = _preview(block)
    delimiters = (forced,) if forced else _DELIMITERS
    if (beside := _beside_settings(lines, delimiters)) is not None:
        return beside
    found = _best_delimiter(lines, delimiters, lambda cell: is_number(cell) or is_grouped(cell))
    if found is None or 2.0 * found[0] < len(lines):
        affixed = _best_delimiter(lines, delimiters, is_affixed)
        # Title lines, too, may have numbers with units.
        if affixed is not None and (found is None or affixed[0] > 2.0 * found[0]):
            score, delimiter, fields, at = affixed
            found = (score, delimiter, fields, _first_usual(lines, delimiter, fields, at))
    if found is None:
        raise _no_samples(lines, comments)
    _, delimiter, fields, at = found
    if fields > limits.columns:
        raise FileTooLarge(
            f"{fields} columns are more than the limit of {limits.columns}; "
            "export only the channels of the motor",
            row=lines[at].number,
            value=fields,
        )
    bare = _bare_cells(lines[at:], delimiter, fields)
    if bare is not None:
        lines[at:] = [replace(line, text=bare.line(line.text)) for line in lines[at:]]
    _refuse_unclear_commas(lines[at:], delimiter, fields)
    noted = [line for line in comments if line.number < lines[at].number]
    above = [*lines[:at], *noted]
    cells = [split_cells(line.text, delimiter) for line in above]
    titles = [line.text for line in (*lines[:at], *comments)]
    preamble = replace(read_preamble(cells), interval=stated_interval(titles))
    keyed = {above[k].number for k in keyed_rows(cells)}
    above, noted = ([x for x in y if x.number not in keyed] for y in (lines[:at], noted))
    if bare is not None and any(bare.labels):
        rows = []
    else:
        rows = HeaderRows(delimiter, fields, lines[at]).above(above, noted, preamble.names())
    header = tuple(tuple(cells) for _, cells in rows)
    header += bare.header if bare is not None else ()
    samples = [split_cells(line.text, delimiter) for line in lines[at:]]
    bare = (bare or BareCells.of(delimiter, [""] * fields)).with_clock(header, samples) or bare
    return Layout(
        delimiter,
        fields,
        header,
        rows[0][0].number if rows else lines[at].number,
        lines[at].number,
        preamble,
        tuple(split_cells(lines[at].text, delimiter)),
        bare=bare,
    )


def _first_usual(lines: list[Line], delimiter: str, fields: int, at: int) -> int:
    """Index of the first line, from `at` on, with the labels and units of most lines."""
    rows = {k: split_cells(line.text, delimiter) for k, line in enumerate(lines) if k >= at}
    kinds = {k: BareCells.of(delimiter, c) for k, c in rows.items() if len(c) == fields}
    usual, _ = Counter(kinds.values()).most_common(1)[0]
    return next(k for k, kind in kinds.items() if kind == usual)


def _bare_cells(lines: list[Line], delimiter: str, fields: int) -> BareCells | None:
    """Rewriting of samples with labels, units or thousands separators; None if there are none."""
    bare = BareCells.of(delimiter, split_cells(lines[0].text, delimiter))
    rows = (split_cells(line.text, delimiter) for line in lines)
    is_needed = bool(bare.header) or any(map(is_grouped, itertools.chain.from_iterable(rows)))
    return bare if is_needed else None


def _beside_settings(lines: list[Line], delimiters: tuple[str, ...]) -> Layout | None:
    """Layout of samples from the first line on, with the settings of a device left of the first.

    Oscilloscopes of Tektronix (TDS, TBS) write keys and values in the lines of the first samples;
    in the lines below, the same cells are blank.
    """
    for delimiter in delimiters if lines else ():
        if split_cells(lines[-1].text, delimiter)[0]:
            continue
        rows = [split_cells(line.text, delimiter) for line in lines]
        blank = Counter(next((k for k, cell in enumerate(c) if cell), 0) for c in rows)
        start, count = blank.most_common(1)[0]
        first = rows[0]
        below = next(cells for cells in rows if not any(cells[:start]))[start:]
        is_sample = len([cell for cell in below if is_number(cell)]) > 1
        is_sample &= any(map(is_number, first[start:]))
        if start < 2 or 2 * count < len(rows) or not is_sample or is_number(first[0] or "0"):
            continue
        preamble = read_preamble([cells[:start] for cells in rows if cells[0]])
        header, number = (("",) * (len(first) - start),), lines[0].number
        layout = Layout(delimiter, len(first), header, number, number, preamble, tuple(first))
        return replace(layout, first_field=start)
    return None


def _preview(block: Block) -> tuple[list[Line], list[Line], str | None]:
    """Non-blank lines, comment lines without their marks, and the delimiter of a ``sep=`` line."""
    raw = block.text.split(b"\n", _PREVIEW_LINES)
    if len(raw) > _PREVIEW_LINES or block.terminated:
        raw.pop()
    texts = replace(block, text=b"\n".join(raw)).lines
    lines: list[Line] = []
    comments: list[Line] = []
    forced = None
    for number, text in _joined(texts, block.first_line):
        stripped = text.strip()
        if number == 1 and re.fullmatch(r'"?sep=[,;\t]"?', text.strip(" ")):
            forced = text.strip(' "')[-1]
        elif stripped.startswith(COMMENT_MARKS):
            comments.append(Line(number, stripped.lstrip("#%/ ")))
        elif stripped:
            lines.append(Line(number, text))
    if not lines and not comments:
        raise EmptyFile("only blank lines; expected a header and samples")
    return lines, comments, forced


def _joined(texts: list[str], first_line: int) -> list[tuple[int, str]]:
    """Join the lines of a quoted cell that contains line breaks, as spreadsheets write them."""
    joined: list[tuple[int, str]] = []
    at = 0
    while at < len(texts):
        end = at + 1
        if texts[at].count('"') % 2:
            stops = range(at + 2, min(at + 6, len(texts)) + 1)
            closed = (stop for stop in stops if "".join(texts[at:stop]).count('"') % 2 == 0)
            end = next(closed, end)
        joined.append((first_line + at, " ".join(texts[at:end])))
        at = end
    return joined


def _best_delimiter(
    lines: list[Line], delimiters: tuple[str, ...], is_value: Callable[[str], bool]
) -> tuple[float, str, int, int] | None:
    """Highest score, its delimiter, number of fields, and index of the first sample."""
    best: tuple[float, str, int, int] | None = None
    for delimiter in delimiters:
        # A line without the delimiter is one cell, which no table has.
        rows = [
            split_cells(line.text, delimiter) if _is_divided(line.text, delimiter) else []
            for line in lines
        ]
        label = _label(rows)
        shares = [_share_of_numbers(cells, is_value, label) for cells in rows]
        counts = Counter(len(cells) for cells, share in zip(rows, shares, strict=True) if share)
        if not counts:
            continue
        fields = counts.most_common(1)[0][0]
        score = sum(s for s, cells in zip(shares, rows, strict=True) if len(cells) == fields)
        if best is None or score > best[0]:
            at = next(k for k, s in enumerate(shares) if s and len(rows[k]) == fields)
            while at and _is_first(rows[at - 1], rows[at], fields):
                at -= 1
            best = (score, delimiter, fields, at)
    return best


def _is_first(cells: list[str], below: list[str], fields: int) -> bool:
    """Return True for a sample above another one, with few values or with a label in front."""
    is_sparse = "" in cells[1:-1] and (is_number(cells[0]) or is_clock(cells[0]))
    is_labelled = not below[0] and cells[0] == TRACE and all(map(is_number, cells[1:]))
    return len(cells) == fields and (is_sparse or is_labelled)


def _is_divided(text: str, delimiter: str) -> bool:
    """Return False for a line that `split_cells` does not divide."""
    return delimiter in text if delimiter != " " else '"' in text or len(text.split(None, 1)) > 1


def _label(rows: list[list[str]]) -> str:
    """Text in front of most lines, such as the name of a device; blank if there is none."""
    firsts = Counter(cells[0] for cells in rows if len(cells) > 1)
    text, count = firsts.most_common(1)[0] if firsts else ("", 0)
    # A blank between date and time does not divide the lines of a table.
    is_value = is_number(text) or is_clock(text)
    return text if 2 * count > len(rows) and not is_value else ""


def _share_of_numbers(cells: list[str], is_value: Callable[[str], bool], label: str) -> float:
    """Fraction of the filled cells that are numbers; 0 if the line is not a sample.

    The first cell may hold the label of all lines.
    """
    if len(cells) < 2:
        return 0.0
    cells = ["", *cells[1:]] if label and cells[0] == label else cells
    filled = [cell for k, cell in enumerate(cells) if cell and (k == 0 or not is_time_of_day(cell))]
    numbers = [cell for cell in filled if is_value(cell) or is_number_word(cell)]
    begins = not any(cells[:1]) or cells[0] in numbers or is_clock(cells[0])
    is_sample = begins and len(numbers) >= max(2, len(filled) // 2 + 1)
    return len(numbers) / len(filled) if is_sample else 0.0


def _refuse_unclear_commas(lines: list[Line], delimiter: str, fields: int) -> None:
    """Reject ``1,234`` if no number in the preview shows whether it means 1.234 or 1234."""
    unclear: tuple[Line, str] | None = None
    for line in lines:
        cells = split_cells(line.text, delimiter)
        for cell in cells if len(cells) == fields else ():
            if not is_number(cell):
                continue
            if "." in cell or ("," in cell and not _MAYBE_THOUSANDS.fullmatch(cell)):
                return
            if "," in cell and unclear is None:
                unclear = (line, cell)
    if unclear is not None:
        line, cell = unclear
        raise NotANumber(
            f"{quoted(cell)} is ambiguous: the comma may be a decimal comma or a thousands "
            "separator, and no other number in the file decides it; use a decimal point",
            row=line.number,
            value=cell,
        )


def _no_samples(lines: list[Line], comments: list[Line]) -> RunFileError:
    """Error for a text in which no delimiter yields lines of numbers."""
    searched = 0
    for line in (*lines, *comments):
        searched += len(line.text)
        if searched > _SEARCHED_CHARACTERS:
            break
        for delimiter in _DELIMITERS:
            cells = split_cells(line.text, delimiter)
            if sum(map(is_channel_name, cells)) >= 2:
                return NoRows(
                    f"no line of numbers below the header ({listed(cells, 6)}); "
                    "expected one line for each sample",
                    row=line.number,
                )
    numbers = sorted(len(_NUMBERS.findall(line.text[:_SHOWN])) for line in lines)
    typical = numbers[len(numbers) // 2] if numbers else 0
    hint = {
        0: "",
        1: "; most lines have a single number: export the time of each sample beside its value, or "
        "all channels as columns of one table",
    }.get(typical, "; the numbers stand within other text: write them alone, and names above them")
    return NoTable(
        f"no line with numbers in columns among the first {_PREVIEW_LINES} lines{hint}; expected a "
        "header and one line for each sample, separated by comma, semicolon, tab or blank",
        row=lines[0].number if lines else None,
        value=lines[0].text[:80] if lines else None,
    )
