"""Documentation refers to existing commands, links, files, functions and decisions."""

from __future__ import annotations

import ast
import functools
import importlib
import os
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer

from app.cli import app as command_line

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "data/**/*.md", "benchmarks/**/*.md")
    for path in ROOT.glob(pattern)
)
COMMANDS = typer.main.get_command(command_line)
DECISIONS = [page for page in PAGES if page.startswith("docs/adr/")]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
PATH = re.compile(
    r"`((?:app|identification|bench|benchmarks|data|docs|tests|requirements)/[\w./-]*)`"
)


@functools.cache
def read(page: str) -> str:
    """Text of a page of the project."""
    return (ROOT / page).read_text(encoding="utf-8")


@functools.cache
def make_targets() -> set[str]:
    """Targets of the Makefile that have a line in `make help`."""
    return set(re.findall(r"^([a-z-]+):[^#\n]*## ", read("Makefile"), re.MULTILINE))


def shell_lines(page: str) -> Iterator[list[str]]:
    """Commands in the shell blocks of a page, as words; continued lines are joined."""
    for language, block in FENCE.findall(read(page)):
        if language in {"sh", "bash", "console"}:
            for line in block.replace("\\\n", " ").splitlines():
                yield shlex.split(line.removeprefix("$ "), comments=True)


def command_words(words: list[str]) -> list[str]:
    """Command without preceding assignments: `A=1 make test` is `make test`."""
    while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
        words = words[1:]
    return words


@functools.cache
def anchors(page: str) -> set[str]:
    """Link anchors of the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", read(page)), re.MULTILINE)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings
    }


def definitions(file: str) -> set[str]:
    """Functions, classes and methods of a file, methods as `Class.method`."""
    names = set()
    for node in ast.parse(read(file)).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{n.name}" for n in node.body if isinstance(n, ast.FunctionDef)}
        if isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return names


@pytest.mark.parametrize("page", PAGES)
def test_every_make_target_on_a_page_exists(page: str) -> None:
    """Targets in shell blocks and backticks are those that `make help` lists."""
    lines = [command_words(words) for words in shell_lines(page)]
    named = {
        word for words in lines if words[:1] == ["make"] for word in words[1:] if "=" not in word
    }
    named |= set(re.findall(r"`make ([a-z-]+)", read(page)))

    assert named - make_targets() == set()


@pytest.mark.parametrize("page", PAGES)
def test_every_command_on_a_page_is_defined(page: str) -> None:
    """`motorid NAME --option` in shell blocks uses defined commands and options."""
    for words in map(command_words, shell_lines(page)):
        if not words or Path(words[0]).name != "motorid":
            continue
        command, rest = COMMANDS, words[1:]
        while rest and rest[0] in (below := getattr(command, "commands", {})):
            command, rest = below[rest[0]], rest[1:]
        options = {name for parameter in command.params for name in parameter.opts}
        options |= {name for parameter in command.params for name in parameter.secondary_opts}
        given = {word.split("=")[0] for word in rest if word.startswith("--")}

        assert command is not COMMANDS or given, f"{page}: {' '.join(words)} names no command"
        assert given - options - {"--help"} == set(), f"{page}: {' '.join(words)}"


@pytest.mark.parametrize("page", PAGES)
def test_every_link_on_a_page_has_a_target(page: str) -> None:
    """A relative link leads to a file, and its anchor to a heading of that file."""
    for link in LINK.findall(FENCE.sub("", read(page))):
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = link.partition("#")
        reached = (ROOT / page).parent / target if target else ROOT / page
        assert reached.exists(), f"{page}: {link}"
        if anchor:
            inside = os.path.relpath(reached.resolve(), ROOT.resolve())
            assert anchor in anchors(inside), f"{page}: {link}"


@pytest.mark.parametrize("page", [page for page in PAGES if page != "CHANGELOG.md"])
def test_every_path_on_a_page_exists(page: str) -> None:
    """Paths in backticks that begin with a folder of the project."""
    missing = [path for path in PATH.findall(read(page)) if not (ROOT / path).exists()]

    assert missing == []


@pytest.mark.parametrize("page", PAGES)
def test_every_name_that_an_example_imports_exists(page: str) -> None:
    """Names of the library, the service and the client in the Python blocks of a page."""
    missing = [
        f"{node.module}.{alias.name}"
        for language, block in FENCE.findall(read(page))
        if language in {"python", "py"}
        for node in ast.walk(ast.parse(block))
        if isinstance(node, ast.ImportFrom) and node.module
        if node.module.partition(".")[0] in {"app", "identification", "motorid"}
        for alias in node.names
        if not hasattr(importlib.import_module(node.module), alias.name)
    ]

    assert missing == []


def test_readme_shows_a_command_before_line_25() -> None:
    """The first screen contains a description and a command to type."""
    text = read("README.md")

    first = text[: text.index("```sh")].count("\n") + 1

    assert first < 25
    assert {"demo", "test"} <= {
        word for words in shell_lines("README.md") if words[:1] == ["make"] for word in words
    }


def test_makefile_lists_every_target_that_can_be_called() -> None:
    """Every phony target except the internal one has a line in `make help`."""
    phony = set(re.findall(r"^\.PHONY: (\S+)$", read("Makefile"), re.MULTILINE)) - {"FORCE"}
    shown = subprocess.run(
        ["make", "--no-print-directory"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout

    assert make_targets() == phony
    assert set(re.findall(r"^  make ([a-z-]+) ", shown, re.MULTILINE)) == phony


def test_decisions_are_numbered_without_a_gap() -> None:
    """Each decision has a unique number, by which it is cited."""
    numbers = [int(Path(page).name[:4]) for page in DECISIONS]

    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= 4


@pytest.mark.parametrize("page", DECISIONS)
def test_decision_has_status_context_decision_and_consequences(page: str) -> None:
    """A record has 40 to 70 lines and its parts in order, with good and bad consequences."""
    text = read(page)
    headings = re.findall(r"^##+ (.+)$", text, re.MULTILINE)
    wanted = ["Context", "Decision", "Alternatives refused", "Consequences", "Positive", "Negative"]

    assert [heading for heading in headings if heading in wanted] == wanted
    assert re.search(
        r"^Status: (proposed|accepted|superseded by \d{4}), \d{4}-\d\d-\d\d$", text, re.M
    )
    assert re.match(rf"# {Path(page).name[:4]} ", text)
    assert 40 <= text.count("\n") <= 70


def test_decisions_are_all_listed() -> None:
    """The index contains one link to each record."""
    linked = LINK.findall(read("docs/README.md"))

    assert [f"docs/{link}" for link in linked if link.startswith("adr/")] == DECISIONS


def test_every_equation_of_the_source_has_a_function() -> None:
    """Each of equations 1 to 16 of the paper is listed with an existing file and function."""
    rows = re.findall(
        r"^\| \((\d+)\)(?:-\((\d+)\))? \|.*\|(.*)\|$", read("docs/equations.md"), re.M
    )
    covered = [n for first, last, _ in rows for n in range(int(first), int(last or first) + 1)]

    assert covered == list(range(1, 17))
    for *_, place in rows:
        cited = re.findall(r"`([\w/]+\.py)` `([\w.]+)`", place)
        assert cited, place
        for file, name in cited:
            assert name in definitions(file), f"{file} has no {name}"


def test_every_drawing_is_well_formed() -> None:
    """A browser shows an error in place of one that is not."""
    drawings = list((ROOT / "docs").glob("**/*.svg"))
    assert drawings
    for drawing in drawings:
        root = ElementTree.parse(drawing).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg", drawing


def test_changelog_begins_with_this_version() -> None:
    """The newest heading is the version in pyproject.toml, dated or unreleased."""
    number = tomllib.loads(read("pyproject.toml"))["project"]["version"]
    newest = re.findall(r"^## (.+)$", read("CHANGELOG.md"), re.MULTILINE)[0]

    assert re.fullmatch(rf"{re.escape(number)} \((unreleased|\d{{4}}-\d\d-\d\d)\)", newest)
