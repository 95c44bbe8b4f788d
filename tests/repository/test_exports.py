"""Module docstrings, exported names and file lengths."""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
from pathlib import Path
from types import FunctionType, ModuleType

import identification

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for package in ("app", "identification", "motorid", "bench", "benchmarks")
    for path in (ROOT / package).rglob("*.py")
)
LIBRARY = [file for file in FILES if file.startswith(("app/", "identification/", "motorid/"))]
# From 300 lines on, look for a second idea in the file; at this limit, split it.
LONGEST_FILE_IN_LINES = {"app": 350, "identification": 350}
LONGEST_FUNCTION_IN_LINES = 60
METHODS = (FunctionType, classmethod, staticmethod, property, functools.cached_property)


@functools.cache
def parsed(file: str) -> ast.Module:
    """Syntax tree of a file of the project."""
    return ast.parse((ROOT / file).read_text(encoding="utf-8"), filename=file)


def defined(tree: ast.Module) -> set[str]:
    """Public names of functions, classes and constants that a module defines."""
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
    """Literal `__all__` of a module; None if it has none."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=value):
                return list(ast.literal_eval(value))
    return None


def test_every_file_begins_with_a_docstring() -> None:
    """The first statement is a docstring of at least one sentence."""
    first = {file: (ast.get_docstring(parsed(file)) or "").partition("\n")[0] for file in FILES}

    assert {
        f: line for f, line in first.items() if not line.rstrip().endswith((".", ":", "?"))
    } == {}


def imported(file: str) -> ModuleType:
    """Module of a file of the project."""
    return importlib.import_module(
        file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    )


def test_every_file_of_the_packages_lists_its_public_names() -> None:
    """Each module that defines a public name has `__all__`, and its names exist."""
    listed = {file: exported(parsed(file)) for file in LIBRARY}
    unlisted = {file: defined(parsed(file)) for file in LIBRARY if listed[file] is None}
    names = {file: found for file, found in listed.items() if found is not None}

    assert {file: found for file, found in unlisted.items() if found} == {}
    assert [file for file, found in names.items() if len(found) != len(set(found))] == []
    missing = {f: [n for n in found if not hasattr(imported(f), n)] for f, found in names.items()}
    assert {file: found for file, found in missing.items() if found} == {}


def undescribed(kind: type) -> list[str]:
    """Public methods and properties of a class that neither it nor a base class describes."""

    def texts(name: str) -> list[str | None]:
        members = [vars(base)[name] for base in kind.__mro__ if name in vars(base)]
        return [member.__doc__ for member in members if isinstance(member, METHODS)]

    return [
        f"{kind.__name__}.{name}"
        for name, member in vars(kind).items()
        if isinstance(member, METHODS) and not name.startswith("_") and not any(texts(name))
    ]


def test_every_public_method_is_described_by_its_class_or_a_base_class() -> None:
    """CONTRIBUTING.md: an override has a docstring only if it says more than that of the base."""
    modules = [imported(file) for file in LIBRARY if exported(parsed(file)) is not None]
    kinds = [
        kind
        for module in modules
        for name, kind in vars(module).items()
        if inspect.isclass(kind) and kind.__module__ == module.__name__ and name[0] != "_"
    ]

    assert {k.__module__: found for k in kinds if (found := undescribed(k))} == {}


def test_a_method_without_any_docstring_is_found() -> None:
    """An undescribed override of a described method passes; a new undescribed method does not."""

    def size(_: object) -> int:
        """Size."""
        return 0

    described = type("Described", (), {"size": size})
    members = {"size": lambda _: 1, "name": property(lambda _: "")}
    derived = type("Derived", (described,), members)

    assert undescribed(derived) == ["Derived.name"]


def test_public_names_of_the_library_are_sorted() -> None:
    """`identification.__all__` is in alphabetical order, capitals first."""
    assert sorted(identification.__all__) == list(identification.__all__)


def test_public_names_of_the_library_are_all_that_is_visible() -> None:
    """Besides submodules, `dir(identification)` shows exactly the names in `__all__`."""
    submodules = {entry.stem for entry in (ROOT / "identification").iterdir()}

    visible = {name for name in dir(identification) if not name.startswith("_")}

    assert visible - submodules - {"annotations"} == set(identification.__all__)


def test_no_file_exceeds_the_length_limit() -> None:
    """The limits are above; 400 lines outside the library and the service."""
    lines = {file: (ROOT / file).read_text(encoding="utf-8").count("\n") for file in FILES}
    limits = {file: LONGEST_FILE_IN_LINES.get(file.partition("/")[0], 400) for file in FILES}

    assert {file: count for file, count in lines.items() if count > limits[file]} == {}


def test_no_function_exceeds_the_length_limit() -> None:
    """Signature and docstring count; the limit is the constant above."""
    lengths = {
        (file, node.name, node.lineno): (node.end_lineno or node.lineno) - node.lineno + 1
        for file in LIBRARY
        for node in ast.walk(parsed(file))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }

    assert {
        place: lines for place, lines in lengths.items() if lines > LONGEST_FUNCTION_IN_LINES
    } == {}


def test_no_submodule_hides_a_public_function_or_class() -> None:
    """A module named `predict` would replace the function of that name once imported."""
    submodules = {entry.stem for entry in (ROOT / "identification").iterdir()}

    assert submodules & set(identification.__all__) == set()
