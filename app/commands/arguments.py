"""Command-line argument parsing: multi-value options, column mappings and NAME=VALUE settings.

--validation a.csv b.csv            same as --validation a.csv --validation b.csv
--temperature -40 25 125
--controller P:1 PI:2,0.5
--set Ra25=0.59 Kt25=0.071
--known Kt25=0.048+-5% L=2.9e-3
--nameplate voltage=12 no_load_speed=3000rpm
--limit voltage=24 current=10
--map 'current_A=CH2 * 2.5 + 0.1 in mA'
--map 'voltage_V=pwm * dir * 0.24'
--map 'time_s=row / 1000' --map voltage_V=12
--map 'run3.csv:current_A=CH2 * -1'     for that file only
"""

from __future__ import annotations

import json
import math
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import typer.core

from identification.errors import OptionError
from identification.numerals import decimal_of, whole_of

__all__ = [
    "SeveralWords",
    "check_mapped_files",
    "decimal",
    "map_arguments",
    "mapping_of",
    "run_names",
    "values_by_name",
    "whole",
]

Number = TypeVar("Number", float, int)

_MAP_FORM = (
    "CHANNEL=HEADER, or FILE:CHANNEL=HEADER * DIRECTION * SCALE + OFFSET in UNIT mod PERIOD with "
    "optional parts, or CHANNEL=NUMBER for a constant"
)


def _is_number(word: str) -> bool:
    return re.fullmatch(r"-?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", word) is not None


class SeveralWords(typer.core.TyperCommand):
    """Command whose options may take a variable number of values.

    Click supports only a fixed number of values per option.  Here each further value becomes a
    repeated option before click parses the arguments.
    """

    several: ClassVar[dict[str, Callable[[str], bool]]] = {
        "--validation": lambda word: not word.startswith("-"),
        "--temperature": _is_number,
        "--controller": lambda word: re.match(r"(?i)[a-z+]{1,5}:", word) is not None,
        "--kind": lambda word: re.fullmatch(r"(?i)p|pi|pi\+ff|pid", word) is not None,
        **dict.fromkeys(
            ("--known", "--limit", "--nameplate", "--set"),
            lambda word: re.match(r"\w+=", word) is not None,
        ),
    }

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option for each value, then parse with click."""
        return super().parse_args(ctx, list(self.spread(args)))

    @classmethod
    def spread(cls, words: Sequence[str]) -> Iterable[str]:
        """Arguments with each value written as ``--option=value``."""
        place = 0
        while place < len(words):
            word = words[place]
            place += 1
            belongs = cls.several.get(word)
            if belongs is None or place == len(words):
                yield word
                if word == "--":
                    yield from words[place:]
                    return
                continue
            # The first value is not tested here: if it is invalid, click's message gives the
            # reason.
            yield f"{word}={words[place]}"
            place += 1
            while place < len(words) and belongs(words[place]):
                yield f"{word}={words[place]}"
                place += 1


def decimal(word: object) -> float:
    """Typer parser of a decimal number; any other text is a `BadParameter`."""
    return _parsed(decimal_of, word, "a number; expected one such as 25 or 2.5e1")


def whole(word: object) -> int:
    """Typer parser of an integer; any other text is a `BadParameter`."""
    return _parsed(whole_of, word, "an integer; expected one such as 3")


def _parsed(read: Callable[[str], Number], word: object, expected: str) -> Number:
    try:
        return read(str(word))
    except ValueError:
        raise typer.BadParameter(f"{str(word)!r} is not {expected}") from None


def values_by_name(settings: Sequence[str]) -> dict[str, float]:
    """Parse ``NAME=VALUE`` settings such as ``Ra25=0.59``.

    Raises:
        OptionError: A text has another form, a name is unknown or repeated, or a value is not a
            finite number.
    """
    from identification.quantities import DECLARED_PARAMETERS

    values: dict[str, float] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in DECLARED_PARAMETERS:
            raise OptionError(
                f"--set {setting!r}: expected NAME=VALUE, where NAME is one of "
                f"{', '.join(DECLARED_PARAMETERS)}"
            )
        if name in values:
            raise OptionError(f"--set {name} is repeated; expected one value")
        try:
            values[name] = decimal_of(text)
        except ValueError:
            values[name] = math.nan
        if not math.isfinite(values[name]):
            raise OptionError(
                f"--set {name}: {text!r} is not a number; expected one in "
                f"{DECLARED_PARAMETERS[name].unit}"
            )
    return values


def mapping_of(file: Path | None, settings: Sequence[str]) -> dict[str, object] | None:
    """Mapping of columns to channels from a file and from ``--map`` texts, which override the file.

    Args:
        file: JSON file of a mapping, or None.
        settings: Texts such as ``current_A=CH2 * 2.5 in mA``; an empty header omits an optional
            channel, and the prefix ``run3.csv:`` restricts the text to that file.
            ``table=Sheet2`` selects a table of the file.

    Returns:
        Mapping for `read_run`, or None if neither was given.

    Raises:
        OptionError: A text has another form.
        MappingError: The content of the file or of a text is not accepted.
    """
    if file is None and not settings:
        return None
    from identification.ingest import read_mapping
    from identification.ingest.mapping import FILES

    mapping: dict[str, Any] = {}
    if file is not None:
        read_mapping(file)
        mapping = json.loads(file.read_text(encoding="utf-8-sig"))
    for setting in settings:
        name, channel, entry = _map_entry(setting)
        into = mapping if name is None else mapping.setdefault(FILES, {}).setdefault(name, {})
        into[channel] = entry
    read_mapping(mapping)
    return mapping


def map_arguments(examples: Sequence[Mapping[str, Any]]) -> str:
    """The ``--map`` options of mappings of an `InputError`, each a remedy, for a user to copy."""
    return " or ".join(" ".join(_map_options(example)) for example in examples)


def _map_options(example: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """The ``--map`` options of one mapping, of which those of single files have a prefix."""
    for channel, entry in example.items():
        if channel == "files":
            for file, entries in entry.items():
                yield from _map_options(entries, f"{file}:")
        else:
            yield f"--map {shlex.quote(prefix + _map_text(channel, entry))}"


def _map_text(channel: str, entry: Mapping[str, Any] | str | None) -> str:
    """Text from which `_map_entry` reads an entry of a mapping."""
    if not isinstance(entry, Mapping):
        return f"{channel}={entry or ''}"
    words = [f"{channel}={entry.get('column') or entry['value']}"]
    for key, sign in (
        ("sign", "*"),
        ("scale", "*"),
        ("offset", "+"),
        ("unit", "in"),
        ("period", "mod"),
    ):
        if key in entry:
            value = entry[key]
            words.append(f"{sign} {value if isinstance(value, str) else f'{value:.12g}'}")
    return " ".join(words)


def run_names(files: Sequence[Path]) -> list[str]:
    """Names of runs: file names, with as many folders as tell runs of one name apart.

    Messages, ``--map FILE:...`` and the result refer to a run by its name.
    """
    paths = [Path(os.path.abspath(file)).parts for file in files]
    names = []
    for parts in paths:
        depth = 1
        others = [other for other in paths if other != parts]
        while depth < len(parts) and any(other[-depth:] == parts[-depth:] for other in others):
            depth += 1
        names.append("/".join(parts[-depth:]))
    return names


def check_mapped_files(mapping: Mapping[str, object] | None, files: Sequence[Path]) -> None:
    """Raise `OptionError` for a mapping entry of a file that is not read, as if misspelt."""
    from identification.ingest.mapping import FILES

    mapped = (mapping or {}).get(FILES)
    names = set(run_names(files))
    for name in mapped if isinstance(mapped, Mapping) else ():
        if name not in names:
            raise OptionError(
                f"the mapping has an entry for the file {name!r}; expected one of "
                f"{', '.join(sorted(names))}"
            )


def _map_entry(setting: str) -> tuple[str | None, str, dict[str, object] | str | None]:
    from identification.ingest.mapping import CONSTANTS, SIGNED, TABLE

    place, equals, column = (part.strip() for part in setting.partition("="))
    name, colon, channel = (part.strip() for part in place.rpartition(":"))
    file = name if colon else None
    if not equals or re.fullmatch(r"\w+", channel) is None or file == "":
        raise OptionError(f"--map {setting!r}: expected {_MAP_FORM}")
    if channel == TABLE:
        return file, channel, column
    column, period = _cut_at("mod", column)
    column, unit = _cut_at("in", column)
    column, offset = _cut_at("+", column)
    if not column:
        return file, channel, None
    constant = _number_or_none(column) if channel in CONSTANTS and not offset else None
    if constant is not None:
        return file, channel, {"value": constant, **({"unit": unit} if unit else {})}
    entry = _product(setting, column, is_signed=channel in SIGNED)
    for key, text in (("offset", offset), ("period", period)):
        if text is not None:
            entry[key] = _map_number(setting, text)
    if unit is not None:
        entry["unit"] = unit
    return file, channel, entry


def _product(setting: str, text: str, *, is_signed: bool) -> dict[str, object]:
    """Column, sign and scale of ``HEADER * DIRECTION * 2 / 1000``.

    A header may contain the operators: a divisor is a number, and one factor is a direction.
    """
    # A run of blanks is tried from its first one only, or many blanks would take quadratic time.
    *rest, word = re.split(r"((?<!\s)\s+[*/]\s+)", text)
    entry: dict[str, object] = {}
    scale = 1.0
    while rest:
        is_product = rest[-1].strip() == "*"
        number = _number_or_none(word)
        if number is not None and (is_product or number):
            entry["scale"] = scale = scale * number if is_product else scale / number
        elif is_product and is_signed and "sign" not in entry and not _is_number(word[:1]):
            entry["sign"] = word
        else:
            break
        rest.pop()
        word = rest.pop()
    if rest and rest[-1].strip() == "*" and not word.count(" "):
        _map_number(setting, word)
    return {"column": "".join([*rest, word]), **entry}


def _cut_at(word: str, text: str) -> tuple[str, str | None]:
    """Texts before and after the last but one word, if that is `word`; else the text and None."""
    parts = text.rsplit(maxsplit=2)
    if len(parts) == 3 and parts[1] == word:
        return parts[0], parts[2]
    return text, None


def _number_or_none(word: str) -> float | None:
    try:
        return decimal_of(word)
    except ValueError:
        return None


def _map_number(setting: str, text: str) -> float:
    try:
        return decimal_of(text)
    except ValueError:
        raise OptionError(
            f"--map {setting!r}: {text!r} is not a number; expected {_MAP_FORM}"
        ) from None
