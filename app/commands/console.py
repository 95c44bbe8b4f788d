"""Console output: progress bar on a terminal, tables, and JSON for scripts.

Results go to standard output, the progress bar and remarks to standard error, so that a pipe
carries results only.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from app.commands.exits import raise_missed
from identification.result.effect_texts import effect_details
from identification.result.numbers import (
    UNKNOWN,
    Interval,
    entry_text,
    unit_prefix,
    unit_text,
    with_symbols,
)

__all__ = [
    "Output",
    "Progress",
    "fit_summary",
    "print_feedback",
    "print_fit",
    "print_help",
    "print_rows",
    "progress_bar",
    "remark",
    "results_console",
    "table_with",
]

Progress = Callable[[str, float], None]
"""Callback with the name of the stage and the completed fraction of the job."""

_STAGES = {
    "read": "reading runs",
    "fit": "fitting",
    "effects": "searching for effects",
    "posterior": "sampling the posterior",
    "feedback": "speed loop metrics",
    "report": "writing the report",
    "write": "writing the files",
    "done": "done",
}
_PIPE_WIDTH = 200
# The report comes last, because the user opens it next.
_FILES = {"result": "result.json", "posterior": "posterior.nc", "report": "report.html"}


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Progress]:
    """Show a progress bar on standard error during the block, if not quiet and a terminal.

    Each progress raises an interruption that was lost.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda stage, share: raise_missed()
        return
    columns = (
        TextColumn("{task.description:<22}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)

        def show(stage: str, share: float) -> None:
            raise_missed()
            bar.update(task, description=_STAGES.get(stage, stage), completed=share)

        yield show


@dataclass(frozen=True)
class Output:
    """Content of standard output: text for people, one JSON document for scripts, or nothing."""

    as_json: bool
    quiet: bool

    def show(self, content: object, print_text: Callable[[], None]) -> None:
        """Print a JSON document if one is requested, else the text unless quiet."""
        if self.as_json:
            print(json.dumps(content, indent=2, allow_nan=False))  # noqa: T201
        elif not self.quiet:
            print_text()


def remark(text: str) -> None:
    """Print a remark, which is not an error, on standard error."""
    print(f"motorid: {text}", file=sys.stderr)  # noqa: T201


def fit_summary(result: Mapping[str, Any], out: Path) -> dict[str, Any]:
    """Summary of a fit for scripts: paths of the files and the short parts of the result."""
    files = {
        name: str(out / file) if (out / file).exists() else None for name, file in _FILES.items()
    }
    kept = ("parameters", "effects", "errors", "noise", "feedback", "sampler", "warnings")
    return {"schema_version": 1, "files": files} | {name: result.get(name) for name in kept}


def print_fit(result: Mapping[str, Any], out: Path) -> None:
    """Print warnings, parameters, errors, speed loop metrics and the paths of the files."""
    from identification.reporting.summary import summary_sentences

    console = results_console()
    for warning in result.get("warnings") or ():
        console.print(f"Warning: {with_symbols(warning)}", style="yellow")
    codes = [detail["code"] for detail in result.get("warning_details") or ()]
    if codes:
        print_help(codes)
    for sentence in summary_sentences(result):
        console.print(sentence)
    console.print(_parameters(result))
    for effect in result.get("effects") or ():
        console.print(f"{effect['name']} ({effect['equation']}), {effect_details(effect)}")
    console.print(_errors(result))
    print_feedback(result["feedback"])
    for file in _FILES.values():
        if (out / file).exists():
            # Paths are not wrapped, so that they can be copied.
            print(out / file)  # noqa: T201


def print_help(codes: Iterable[str]) -> None:
    """Print where each code is explained."""
    listed = ", ".join(dict.fromkeys(codes))
    results_console().print(f"What to do: docs/troubleshooting.md on {listed}", style="yellow")


def print_feedback(entries: Sequence[Mapping[str, Any]]) -> None:
    """Print one table per controller, with one column per temperature."""
    from identification.reporting.tables import feedback_tables

    for found in feedback_tables(entries):
        table = table_with(f"Speed loop, {found.controller}", "metric", right=found.temperatures)
        table.add_row("Stability", *(words.partition(";")[0] for words in found.statements))
        for label, unit, cells in found.rows:
            table.add_row(f"{label} [{unit}]", *map(_interval, cells))
        results_console().print(table)


def print_rows(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Print a table of numbers and texts, with a dash for what the runs do not determine."""
    table = table_with("", *columns)
    for row in rows:
        cells = []
        for name in columns:
            cell = row[name] if row.get(f"{name}_identified") is not False else UNKNOWN
            cells.append(f"{cell:.5g}" if isinstance(cell, float) else str(cell or ""))
        table.add_row(*cells)
    results_console().print(table)


def results_console() -> Console:
    """Console on standard output; wide in a pipe, so that lines are not wrapped."""
    width = None if sys.stdout.isatty() else _PIPE_WIDTH
    return Console(file=sys.stdout, width=width, markup=False, highlight=False, emoji=False)


def table_with(title: str, *left: str, right: Sequence[str] = ()) -> Table:
    """Table without lines, with left-aligned columns, then right-aligned ones."""
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for name in left:
        # Names are needed in full, for options such as --map.
        table.add_column(name, overflow="fold")
    for name in right:
        table.add_column(name, justify="right")
    return table


def _parameters(result: Mapping[str, Any]) -> Table:
    from identification.result.entries import known_only_from

    table = table_with("Parameters", "name", "unit", right=("median", "90 % interval"))
    table.add_column("identified")
    rows: list[tuple[str, Mapping[str, Any]]] = [*result["parameters"].items()]
    for effect in result.get("effects") or ():
        # Below their effect: two effects may have a parameter of one name, such as a torque.
        rows.append((effect["name"], {}))
        rows += [(f"  {name}", entry) for name, entry in effect["parameters"].items()]
        for run in effect.get("runs") or ():
            rows += [(f"  {name}, {run['file']}", entry) for name, entry in run["values"].items()]
    for name, entry in rows:
        if not entry:
            table.add_row(name)
            continue
        factor, unit = unit_prefix(entry["unit"], [entry["median"]])
        text = entry_text(entry, factor)
        table.add_row(
            name,
            unit_text(unit),
            text.median + text.power,
            f"{text.low} .. {text.high}{text.power}",
            known_only_from(entry) or ("yes" if entry["identified"] else "NO"),
        )
    return table


def _errors(result: Mapping[str, Any]) -> Table:
    from identification.reporting.tables import error_rows

    table = table_with("Simulation error", "runs", "channel", "unit")
    has_effects = bool(result.get("effects"))
    for stage in ("before", "after") if has_effects else ("",):
        for name in ("RMSE", "NRMSE", "noise ratio"):
            # A word on each line, so that the table fits into 80 characters.
            table.add_column("\n".join(f"{name} {stage}".split()), justify="right")
    for row in error_rows(result):
        before = row.before if has_effects else ()
        table.add_row(row.role, row.channel, row.unit, *before, *row.after)
    return table


def _interval(text: Interval) -> str:
    if UNKNOWN in (text.low, text.high) or text.low == text.median == text.high:
        return f"{text.median}{text.power}"
    return f"{text.median} ({text.low} .. {text.high}){text.power}"
