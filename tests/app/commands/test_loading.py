"""Start of the command line: as a module, and without searches for garbage."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.commands.loading import loading

ROOT = Path(__file__).parents[3]


@loading()
def fail() -> None:
    """Report whether the collector is on, as an error."""
    raise ImportError(str(gc.isenabled()))


def test_no_search_for_garbage_runs_during_an_import() -> None:
    """The collector is off in the block and on after it, also if the import fails."""
    with pytest.raises(ImportError, match="False"):
        fail()

    assert gc.isenabled()


def test_objects_of_imported_modules_are_not_searched_again() -> None:
    """A new interpreter: the first block imports a package, the second finds it imported."""
    program = (
        "import gc\nfrom app.commands.loading import loading\n"
        "with loading():\n    import numpy\nfirst = gc.get_freeze_count()\n"
        "with loading():\n    import numpy\nprint(first, gc.get_freeze_count() - first)"
    )

    printed = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    ).stdout

    frozen, more = map(int, printed.split())
    assert frozen > 10_000
    assert more <= 0


def test_the_command_line_runs_as_a_module() -> None:
    """An unknown file is answered by exit status 2, as by the installed command, not by nothing."""
    run = subprocess.run(
        [sys.executable, "-m", "app.cli", "check", "missing.csv"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert run.returncode == 2
    assert "missing.csv" in run.stderr
