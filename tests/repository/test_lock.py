"""Lock files: pinned versions, markers and hashes, complete and consistent."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from itertools import product
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
GROUPS = PROJECT["dependency-groups"]
LOCKS = ("run", "build", "dev", "peers")
PIN = re.compile(r"(?P<name>[a-z0-9-]+)==(?P<version>[0-9][\w.+!]*)( ; (?P<marker>[^#\\]+?))?")
HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}")
MACHINES = [
    {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": system,
     "platform_machine": machine, "platform_python_implementation": "CPython",
     "platform_system": {"linux": "Linux", "darwin": "Darwin"}[system],
     "implementation_name": "cpython", "os_name": "posix", "extra": ""}
    for python, (system, machine) in product(
        ("3.11", "3.12", "3.13"),
        (("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "x86_64"), ("darwin", "arm64")),
    )
]  # fmt: skip


def requirements(lock: str) -> list[list[str]]:
    """Requirements of a lock file, each as words: first the pin, then its hashes."""
    text = (ROOT / "requirements" / f"{lock}.txt").read_text(encoding="utf-8")
    joined = text.replace("\\\n", " ")
    return [re.split(r" +(?=--hash)", line.strip()) for line in joined.splitlines()]


def pins(lock: str, machine: dict[str, str]) -> dict[str, str]:
    """Versions by name that pip would install from a lock file on a machine."""
    chosen: dict[str, str] = {}
    for pin, *_ in requirements(lock):
        match = PIN.fullmatch(pin)
        assert match, pin
        if match["marker"] is None or Marker(match["marker"]).evaluate(machine):
            assert match["name"] not in chosen, f"{lock}.txt pins {match['name']} twice"
            chosen[match["name"]] = match["version"]
    return chosen


@pytest.mark.parametrize("lock", LOCKS)
def test_each_requirement_is_one_version_with_hashes(lock: str) -> None:
    """A single requirement without hash makes pip refuse the whole file."""
    for pin, *hashes in requirements(lock):
        assert PIN.fullmatch(pin), pin
        assert hashes, pin
        assert [word for word in hashes if not HASH.fullmatch(word)] == []


@pytest.mark.parametrize("lock", LOCKS)
def test_no_lock_file_contains_an_address(lock: str) -> None:
    """Decision 0003: the machine decides from where files are downloaded."""
    text = (ROOT / "requirements" / f"{lock}.txt").read_text(encoding="utf-8")

    found = re.findall(r".*(?:#|://| @ |index-url|find-links|file:).*", text)

    assert found == []


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: "-".join(list(m.values())[1:4]))
@pytest.mark.parametrize(
    ("lock", "wanted"),
    [
        ("run", PROJECT["project"]["dependencies"]),
        ("build", GROUPS["build"]),
        ("dev", PROJECT["project"]["dependencies"]),
        ("dev", GROUPS["build"]),
        ("dev", [line for line in GROUPS["dev"] if isinstance(line, str)]),
        ("peers", GROUPS["peers"]),
    ],
)
def test_lock_file_satisfies_the_bounds_of_the_project(
    lock: str, wanted: list[str], machine: dict[str, str]
) -> None:
    """A changed bound in pyproject.toml requires `make lock`; tested for every machine."""
    locked = pins(lock, machine)

    for requirement in map(Requirement, wanted):
        version = locked.get(canonicalize_name(requirement.name))
        assert version is not None, f"{requirement} is not in {lock}.txt; run make lock"
        assert requirement.specifier.contains(version), f"{requirement}, locked {version}"


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: "-".join(list(m.values())[1:4]))
def test_tested_versions_are_the_shipped_versions(machine: dict[str, str]) -> None:
    """Every version in run.txt and build.txt is the same in dev.txt."""
    tested = pins("dev", machine).items()

    assert pins("run", machine).items() <= tested
    assert pins("build", machine).items() <= tested


def test_build_backend_is_locked_under_the_same_bound() -> None:
    """The environment builds without isolation, so both entries must require the same backend."""
    assert PROJECT["build-system"]["requires"] == GROUPS["build"]


def test_lock_reader_refuses_requirements_without_a_pin() -> None:
    """Negative control: a range, an address and a path are no pins."""
    assert PIN.fullmatch("numpy==2.4.6 ; python_full_version < '3.12'")
    for text in ("numpy>=2.4", "numpy", "numpy @ file:///numpy.whl", "-e .", "numpy==2.4 # why"):
        assert PIN.fullmatch(text) is None


@cache
def imported() -> dict[str, list[str]]:
    """Third-party packages that the code imports, with the importing files."""
    found: dict[str, list[str]] = {}
    packages = ("app", "identification", "motorid")
    for path in [path for package in packages for path in ROOT.glob(f"{package}/**/*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Import(names=names):
                    modules = {alias.name.split(".")[0] for alias in names}
                case ast.ImportFrom(module=str(module), level=0):
                    modules = {module.split(".")[0]}
                case _:
                    continue
            for module in modules - set(sys.stdlib_module_names) - set(packages):
                found.setdefault(module, []).append(str(path.relative_to(ROOT)))
    return found


def declared() -> set[str]:
    """Names of the run-time dependencies in pyproject.toml."""
    return {
        canonicalize_name(Requirement(line).name) for line in PROJECT["project"]["dependencies"]
    }


def extras() -> set[str]:
    """Names of the packages in optional dependencies."""
    groups = PROJECT["project"]["optional-dependencies"].values()
    return {canonicalize_name(Requirement(line).name) for group in groups for line in group}


def test_every_import_of_the_packages_is_a_declared_dependency() -> None:
    """A transitive dependency may disappear with the next version of another package."""
    distributions = packages_distributions()

    undeclared = {
        module: files
        for module, files in imported().items()
        if not {canonicalize_name(n) for n in distributions.get(module, [module])}
        & (declared() | extras())
    }

    assert undeclared == {}


def test_every_declared_dependency_is_imported() -> None:
    """A dependency that no file of the packages imports is a leftover."""
    distributions = packages_distributions()
    used = {
        canonicalize_name(name) for module in imported() for name in distributions.get(module, [])
    }

    assert declared() - used == set()
