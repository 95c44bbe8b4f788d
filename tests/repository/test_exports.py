"""What each file says about itself and offers to others."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

import identification

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for package in ("app", "identification", "motorid", "bench", "benchmarks")
    for path in (ROOT / package).rglob("*.py")
)
LIBRARY = [file for file in FILES if file.startswith(("app/", "identification/", "motorid/"))]
# Past 300 lines one looks for the second idea in a file; past this one it must have been found.
LONGEST_FILE_IN_LINES = 400


def parsed(file: str) -> ast.Module:
    """The syntax tree of a file of the project."""
    return ast.parse((ROOT / file).read_text(encoding="utf-8"), filename=file)


def defined(tree: ast.Module) -> set[str]:
    """Public names of functions, classes and constants that a module binds itself."""
    names: set[str] = set()
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names.add(name)
            case ast.ClassDef(name=name):
                names.add(name)
            case ast.AnnAssign(target=ast.Name(id=name)):
                names.add(name)
            case ast.Assign(targets=targets):
                names.update(target.id for target in targets if isinstance(target, ast.Name))
    return {name for name in names if not name.startswith("_")}


def exported(tree: ast.Module) -> list[str] | None:
    """The literal `__all__` of a module, or None where it has none."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=value):
                return list(ast.literal_eval(value))
    return None


@pytest.mark.parametrize("file", FILES)
def test_every_file_begins_by_saying_what_it_is_for(file: str) -> None:
    """The first statement is a docstring of at least one sentence."""
    docstring = ast.get_docstring(parsed(file))

    assert docstring, f"{file} has no module docstring"
    assert docstring.splitlines()[0].rstrip().endswith((".", ":", "?")), docstring.splitlines()[0]


@pytest.mark.parametrize("file", LIBRARY)
def test_every_file_of_the_packages_lists_what_it_offers(file: str) -> None:
    """`__all__` stands in each module that defines a public name, and the names are there."""
    tree = parsed(file)
    names = exported(tree)

    if names is None:
        assert not defined(tree), f"{file} defines {sorted(defined(tree))} without __all__"
        return
    module = importlib.import_module(
        file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    )
    assert len(names) == len(set(names))
    assert [name for name in names if not hasattr(module, name)] == []


def test_public_names_of_the_library_are_sorted() -> None:
    """One finds a name in `identification.__all__` by the alphabet, capitals first."""
    assert sorted(identification.__all__) == list(identification.__all__)


def test_public_names_of_the_library_are_all_that_is_visible() -> None:
    """What `dir(identification)` shows besides submodules is what `__all__` promises."""
    submodules = {entry.stem for entry in (ROOT / "identification").iterdir()}

    visible = {name for name in dir(identification) if not name.startswith("_")}

    assert visible - submodules - {"annotations"} == set(identification.__all__) - submodules


@pytest.mark.parametrize("file", FILES)
def test_no_file_outgrows_one_idea(file: str) -> None:
    """A file is one idea; the limit is the one written above."""
    lines = (ROOT / file).read_text(encoding="utf-8").count("\n")

    assert lines <= LONGEST_FILE_IN_LINES


def test_the_library_offers_functions_and_classes_and_no_module_of_their_name() -> None:
    """A module named `predict` took the place of the function as soon as it was imported."""
    for name in identification.__all__:
        assert callable(getattr(identification, name))
        assert callable(getattr(identification, name)), "after the import of its module"
