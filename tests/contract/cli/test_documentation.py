"""docs/cli.md matches the program: the help of each command, and the exit statuses.

`python tests/contract/cli/test_documentation.py` regenerates the help texts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from app.cli import app
from app.commands.arguments import SeveralWords
from app.commands.exits import EXIT_STATUS

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"
HELP = re.compile(r"```text\nUsage: (motorid[a-z ]*?) (?:\[|COMMAND|\{).*?```\n", re.DOTALL)


def commands(command: Any, name: str = "motorid") -> Iterator[tuple[str, Any]]:
    """Commands that can be executed, with the words that call them."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield name, command
        return
    for word, below in inner.items():
        yield from commands(below, f"{name} {word}")


KNOWN = dict(commands(typer.main.get_command(app)))


def help_text(name: str) -> str:
    """Output of --help on a terminal of 80 columns, as a block of the page."""
    command = KNOWN[name]
    context = command.make_context(
        name,
        [],
        resilient_parsing=True,
        terminal_width=80,
        help_option_names=["-h", "--help"],
    )
    lines = (line.rstrip() for line in command.get_help(context).splitlines())
    return "```text\n" + "\n".join(lines).strip() + "\n```\n"


@pytest.mark.parametrize("name", KNOWN)
def test_page_shows_the_help_of_every_command(name: str) -> None:
    """The page contains the current help text of each command once."""
    assert PAGE.read_text(encoding="utf-8").count(help_text(name)) == 1


def test_page_shows_no_removed_command() -> None:
    """The page has as many help blocks as there are commands."""
    assert len(HELP.findall(PAGE.read_text(encoding="utf-8"))) == len(KNOWN)


def test_page_lists_every_exit_status() -> None:
    """The table of the page contains exactly the statuses of the program."""
    told = re.findall(r"^\| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)

    assert {int(status) for status in told} == {0, *EXIT_STATUS.values()}


@pytest.mark.parametrize("option", SeveralWords.several)
def test_page_and_help_mark_multi_value_options(option: str) -> None:
    """The page names each option; the placeholder in the help ends with three dots."""
    shown = [line for name in KNOWN for line in help_text(name).splitlines() if option in line]

    assert f"`{option}`" in PAGE.read_text(encoding="utf-8")
    placed = [line for line in shown if re.match(rf"\s+{option} [A-Z=]+", line)]
    assert placed
    assert all("..." in line for line in placed)


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(HELP.sub(lambda match: help_text(match[1].strip()), text), encoding="utf-8")
