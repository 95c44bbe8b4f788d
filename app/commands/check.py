"""The command `check`: examine runs before a fit, and show what was understood."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from app.commands.arguments import check_mapped_files, map_arguments, run_names
from app.commands.console import Output, print_help, remark, results_console, table_with
from app.commands.files import writable_file
from app.commands.loading import loading
from identification.errors import InputError, OptionError, RunFileError
from identification.result.atomic import write_text
from identification.result.numbers import number_text, unit_prefix, unit_text, with_symbols

__all__ = ["check"]


def check(
    files: Sequence[Path],
    mapping: Mapping[str, object] | None,
    save_mapping: Path | None,
    *,
    given: Sequence[str] = (),
    output: Output,
) -> None:
    """Show columns, excitation, contradictions and expected precision of runs of one motor.

    An existing file is replaced by the mapping as understood only if it is a mapping. `given` holds
    the options of the command line that the mapping comes from.

    Raises:
        InputError: A file cannot be read, or runs contradict; all of them have been shown.
        OptionError: The mapping cannot be saved.
    """
    with loading():
        from identification.preview import check as examined

    check_mapped_files(mapping, files)
    if save_mapping is not None:
        _check_replaceable(save_mapping)
    found = examined(files, mapping, names=run_names(files))
    content: Mapping[str, Any] = found.content()
    if save_mapping is not None and any(isinstance(e, RunFileError) for e in found.errors):
        remark(f"{save_mapping} is not written, because not all files are readable")
        save_mapping = None
    if save_mapping is not None:
        with writable_file(save_mapping, "--save-mapping"):
            write_text(save_mapping, json.dumps(found.mapping(), indent=1) + "\n")
    words = ["--mapping", str(save_mapping)] if save_mapping else given
    output.show(content, lambda: _print(content, files, save_mapping, words))
    refused = [finding for finding in found.findings if finding.severity == "refuse"]
    count = sum(1 + len(error.further) for error in found.errors) + len(refused)
    if count:
        first = str(refused[0]) if refused else ""
        for error in content["errors"][:1]:
            first = _described(error)
        unseen = (
            "run without -q to see them" if output.quiet and not output.as_json else "see above"
        )
        raise InputError(first + (f" (and {count - 1} more, {unseen})" if count > 1 else ""))


def _check_replaceable(path: Path) -> None:
    """Raise `OptionError` for an existing file that is no mapping, such as a run."""
    from identification.ingest import read_mapping

    if not path.exists() or path.is_dir():
        return
    try:
        if not path.is_file():
            raise OptionError("is not a regular file")
        read_mapping(path)
    except InputError as error:
        raise OptionError(
            f"--save-mapping {path}: exists and is no mapping, so it is not replaced; choose "
            "another name"
        ) from error


def _print(
    content: Mapping[str, Any], files: Sequence[Path], saved: Path | None, given: Sequence[str]
) -> None:
    console = results_console()
    errors, findings = _listed(content)
    for run in content["runs"]:
        _print_run(console, run)
    for error in errors:
        fault = "Not readable" if error["code"] else "Not sufficient"
        console.print(f"{fault}: {_described(error)}", style="red", soft_wrap=True, markup=False)
    for finding in findings:
        verdict = "Contradiction" if finding["severity"] == "refuse" else "Suspicion"
        place = ", column ".join(word for word in (finding["file"], finding["column"]) if word)
        words = ": ".join(
            word for word in (verdict, place, with_symbols(finding["message"])) if word
        )
        console.print(words, style="yellow", soft_wrap=True)
        for correction in finding["corrections"]:
            console.print(f"  correct it with --map {shlex.quote(correction)}", soft_wrap=True)
    if content["parameters"]:
        console.print(_prospects(content["parameters"]))
    remarks = [warning for run in content["runs"] for warning in run["warnings"]]
    noticed = [*content["errors"], *content["findings"], *remarks]
    if codes := [one["code"] for one in noticed if one["code"]]:
        print_help(codes)
    for note in content["notes"]:
        console.print(f"Note: {note}", soft_wrap=True)
    if saved is not None:
        console.print(f"mapping written to {saved}", soft_wrap=True)
    if content["accepted"]:
        paths = (f"./{file}" if str(file).startswith("-") else str(file) for file in files)
        words = shlex.join([*paths, *given])
        console.print(f"next: motorid fit {words} --out DIR", soft_wrap=True)


def _listed(content: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
    """Errors and findings without the first refusal, if a terminal shows it on standard error."""
    errors, findings = content["errors"], content["findings"]
    if sys.stdout.isatty() and sys.stderr.isatty():
        if errors:
            return errors[1:], findings
        refused = [finding for finding in findings if finding["severity"] == "refuse"]
        return errors, [one for one in findings if one not in refused[:1]]
    return errors, findings


def _described(entry: Mapping[str, Any]) -> str:
    """Message of an error or a warning, with its location and the ``--map`` options that help."""
    known: dict[str, Any] = {name: entry.get(name) for name in ("file", "row", "column")}
    error = InputError(entry["message"], **known, examples=entry.get("examples", ()))
    return error.described(map_arguments)


def _print_run(console: Console, run: Mapping[str, Any]) -> None:
    excitation = run["excitation"]
    duration = number_text(excitation["duration_s"])
    rate = number_text(run["sample_rate_hz"])
    title = f"{run['file']}: {run['rows']} samples, {rate} Hz, {duration} s"
    right = ("unit", "scale", "offset", "range")
    table = table_with(title, "channel", "column", right=right)
    is_derived = any("method" in channel for channel in run["channels"].values())
    if is_derived:
        table.add_column("method")
    for name, channel in run["channels"].items():
        limits = excitation.get(name)
        table.add_row(
            name,
            " * ".join(filter(None, (channel["column"], channel.get("sign")))),
            channel["unit"],
            f"{channel['scale']:g}",
            f"{channel['offset']:g}",
            f"{limits[0]:.4g} .. {limits[1]:.4g} {unit_text(channel['si_unit'])}" if limits else "",
            *([channel.get("method", "")] if is_derived else []),
        )
    console.print(table)
    turned = (
        f"{100 * excitation[key]:.0f} % {word}"
        for key, word in (
            ("forward", "forward"),
            ("reverse", "reverse"),
            ("standstill", "standing"),
        )
    )
    console.print(f"  shaft: {', '.join(turned)}")
    for gap in run["gaps"]:
        console.print(f"  gap of {gap['length_s']:.4g} s after {gap['after_s']:.6g} s")
    for name, count in run["clipped"].items():
        if count:
            console.print(f"  {name}: {count} samples at the limit of the sensor")
    for warning in run["warnings"]:
        console.print(f"  warning: {_described(warning | {'row': None})}", soft_wrap=True)


def _prospects(parameters: Mapping[str, Mapping[str, Any]]) -> Table:
    title = "Precision to expect from these runs if the nominal model is complete"
    table = table_with(title, "name", "unit", right=("estimate", "90 % interval"))
    table.add_column("identified")
    table.add_column("to improve it")
    for name, entry in parameters.items():
        sd, (factor, unit) = entry["expected_sd"], unit_prefix(entry["unit"], [entry["value"]])
        width = "undetermined" if sd is None else f"± {number_text(1.645 * factor * sd, 2)}"
        table.add_row(
            name,
            unit_text(unit),
            "–" if sd is None else number_text(factor * entry["value"], 4),
            width,
            "yes" if entry["identified"] else "NO",
            entry["advice"],
        )
    return table
