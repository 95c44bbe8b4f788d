"""Example of docs/write-an-effect.md, run as printed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs/write-an-effect.md").read_text("utf-8")
LAW, SCRIPT = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
(PRINTED,) = re.findall(r"^```text\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)

IN_TREE = """
import sys
from identification import effects
effects.__path__.append(sys.argv[1])
from identification.effects.catalogue import CATALOGUE, confusions_of
from identification.result.schema import result_schema
names = result_schema()["$defs"]["EffectEntry"]["properties"]["name"]["enum"]
print(list(CATALOGUE)[-1], CATALOGUE["eddy_brake"].__module__, names[-2])
print(confusions_of(["eddy_brake"])[0].parameters)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder that contains only the file of the law."""
    (tmp_path / "eddy_brake.py").write_text(LAW, "utf-8")
    return tmp_path


def output(folder: Path, program: str, *arguments: str) -> str:
    """Output of a program that imports modules from the folder."""
    command = [sys.executable, "-c", program, *arguments]
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_search_finds_the_law_of_the_page(folder: Path) -> None:
    """Name, torque and speed are those of the simulation on the page."""
    assert output(folder, SCRIPT) == PRINTED
    assert "TORQUE, SPEED = 0.05, 60.0" in SCRIPT
    assert "'torque': 0.05, 'speed': 60.0" in PRINTED


def test_a_file_in_the_package_is_in_the_catalogue_and_the_schema(folder: Path) -> None:
    """Nothing imports the module by name; it follows the built-in effects."""
    first, second = output(folder, IN_TREE, str(folder)).splitlines()

    assert first == "eddy_brake identification.effects.eddy_brake eddy_brake"
    assert second == "('b',)"
