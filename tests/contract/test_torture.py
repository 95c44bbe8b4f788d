"""Short versions of the torture tests; `make torture` runs the long ones.

The torture tests of authorisation and names are complete elsewhere and have no short version.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest


@pytest.mark.parametrize("name", ["jobs", "files", "fuzz", "api", "load", "limits"])
def test_short_torture_test_passes(tmp_path: Path, name: str) -> None:
    """Each outcome states the required and the measured value."""
    module = importlib.import_module(f"benchmarks.torture.{name}")

    outcomes = list(module.run(short=True, directory=tmp_path))

    assert outcomes
    failed = [f"{o.test}: asked {o.asked}, measured {o.measured}" for o in outcomes if not o.passed]
    assert failed == []
