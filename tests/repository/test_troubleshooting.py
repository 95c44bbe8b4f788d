"""docs/troubleshooting.md has a paragraph for each code that a user may meet."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from identification import errors

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
SECTIONS = re.split(r"^### (\w+)$", PAGE, flags=re.MULTILINE)[1:]
WORD = re.compile(r"[a-z]+(_[a-z]+)*")
REMARKS = "ResultWarning Finding refusal suspicion warning RunWarning _Hypothesis".split()
"""Functions and classes whose first argument is a code."""


def constants(tree: ast.Module) -> dict[str, str]:
    """Texts that the module gives a name."""
    named = {}
    for node in tree.body:
        match node:
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.Constant(value=str(text))):
                named[name] = text
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=str(text))):
                named[name] = text
    return named


def places(node: ast.AST) -> list[ast.expr]:
    """Expressions that give a code: first arguments of warnings and findings, and `code = ...`."""
    match node:
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=[first, *_]):
            return [first] if name in REMARKS else []
        case ast.keyword(arg="code", value=value):
            return [value]
        case ast.Assign(targets=[ast.Name(id="code")], value=value):
            return [value]
        case ast.Assign(
            targets=[ast.Tuple(elts=[ast.Name(id="code"), *_])], value=ast.Tuple(elts=values)
        ):
            return values[:1]
    return []


def codes_of(path: Path) -> Iterator[str]:
    """Codes that a module gives to warnings and findings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    named = constants(tree)
    for node in ast.walk(tree):
        for value in places(node):
            for part in ast.walk(value):
                match part:
                    case ast.Constant(value=str(text)) if WORD.fullmatch(text):
                        yield text
                    case ast.Name(id=name) if WORD.fullmatch(named.get(name, "")):
                        yield named[name]


def codes() -> set[str]:
    """Codes of errors in run files, remarks on files, findings and warnings of a result."""
    sources = (ROOT / "identification").rglob("*.py")
    found = {code for path in sources for code in codes_of(path)}
    return found | {leaf.code for leaf in errors.RunFileError.__subclasses__()}


def test_every_code_has_its_paragraph() -> None:
    """The expected codes are those in the sources; each heading is one and has text below it."""
    expected = codes()

    assert {"outlying_run", "no_temperature", "reversed_channel", "not_finite"} <= expected
    assert {"exchanged_channels", "suspicious_value", "unexplained_channel"} <= expected
    assert expected - set(SECTIONS[::2]) == set()
    assert all(len(text.split()) > 5 for text in SECTIONS[1::2])


def test_no_paragraph_is_about_a_code_that_does_not_exist() -> None:
    """Headings are unique, and the tables of run files and result.json name each of them."""
    tables = [
        (ROOT / "docs" / page).read_text("utf-8") for page in ("run-files.md", "result-json.md")
    ]
    listed = set(re.findall(r"`(\w+)`", "\n".join(tables)))

    assert len(SECTIONS[::2]) == len(set(SECTIONS[::2]))
    assert set(SECTIONS[::2]) - listed == set()
