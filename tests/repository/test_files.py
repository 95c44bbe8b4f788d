"""Files tracked in git and files in the wheel."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LARGEST_FILE_IN_BYTES = 3_000_000


def files_in_git() -> list[str]:
    """Files that git tracks or would track after `git add`."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    names = sorted(os.fsdecode(name) for name in listed.stdout.split(b"\0") if name)
    return [name for name in names if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """Wheel built by the locked build backend."""
    directory = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", directory],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    (path,) = directory.glob("*.whl")
    return zipfile.ZipFile(path)


def test_no_file_in_git_is_large() -> None:
    """A clone stays small: the limit is 3 MB per file, campaigns included."""
    sizes = {name: (ROOT / name).stat().st_size for name in files_in_git()}

    assert sizes
    assert {name: size for name, size in sizes.items() if size > LARGEST_FILE_IN_BYTES} == {}


def test_no_file_in_git_contains_a_path_of_this_machine() -> None:
    """Neither the folder of this clone, nor its parent, nor a home directory occurs in a file."""
    places = [str(ROOT) + "/", str(ROOT.parent) + "/", str(Path.home()) + "/"]
    # A folder directly below the root, such as /data, is common in containers.
    patterns = [re.escape(place) for place in places if place.strip("/")]
    anywhere = re.compile("|".join([*patterns, r"/(?:home|Users)/[a-z]\w*/"]).encode())

    found = [
        f"{name}: {match.group().decode()}"
        for name in files_in_git()
        if (match := anywhere.search((ROOT / name).read_bytes()))
    ]

    assert found == []


def test_no_generated_file_is_in_git() -> None:
    """Results, caches and environments are regenerated instead."""
    made = re.compile(
        r"(^|/)(__pycache__|\.venv[^/]*|out|dist|build|\.[a-z_]+_cache)/|\.pyc$|\.nc$"
    )

    assert [name for name in files_in_git() if made.search(name)] == []


def test_wheel_holds_every_file_of_its_packages_and_no_other(wheel: zipfile.ZipFile) -> None:
    """Templates and bundled scripts are needed at run time; tests and benchmarks are not."""
    packages = ("app/", "identification/", "motorid/")
    expected = {name for name in files_in_git() if name.startswith(packages)}

    held = {name for name in wheel.namelist() if ".dist-info/" not in name}

    assert held == expected


def test_wheel_contains_the_licence_and_the_command(wheel: zipfile.ZipFile) -> None:
    """The licence accompanies every copy; `motorid` is the command that users type."""
    names = wheel.namelist()
    (entry_points,) = [name for name in names if name.endswith("entry_points.txt")]

    assert [name for name in names if name.endswith("/licenses/LICENSE")]
    assert b"motorid = app.cli:main" in wheel.read(entry_points)


def test_version_is_written_once() -> None:
    """The version is in pyproject.toml; the code reads the installed metadata."""
    written = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    number = written["project"]["version"]
    spelled = [
        str(path.relative_to(ROOT))
        for package in ("app", "identification", "motorid")
        for path in (ROOT / package).rglob("*.py")
        if f'"{number}"' in path.read_text(encoding="utf-8")
    ]

    assert version("motorid") == number
    assert spelled == []


def test_image_is_built_from_pinned_names_and_does_not_run_as_root() -> None:
    """The base has a version tag and a digest; the last USER is numeric and not 0.

    A stage may also continue an earlier one.
    """
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    stages = [line.split()[1:] for line in lines if line.startswith("FROM ")]
    bases = {words[0] for words in stages} - {words[-1] for words in stages if "AS" in words}
    users = [line.split()[1] for line in lines if line.startswith("USER ")]

    [name] = [line.removeprefix("ARG BASE=") for line in lines if line.startswith("ARG BASE=")]

    assert bases == {"${BASE}"}
    assert re.fullmatch(r"[a-z/]+:\d+\.\d+-[\w-]+@sha256:[0-9a-f]{64}", name)
    assert re.fullmatch(r"[1-9]\d*(:[1-9]\d*)?", users[-1])


def test_ci_runs_the_tests_through_make() -> None:
    """The CI calls the command that the README documents."""
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")

    assert script.rstrip().endswith("make test </dev/null")
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
