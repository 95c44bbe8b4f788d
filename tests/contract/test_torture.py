"""The short versions of the torture tests; `make torture` runs the long ones.

Authorisation and names have tests of their own, which are as long as they can be.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest


@pytest.mark.parametrize("name", ["jobs", "files", "fuzz", "api", "load", "limits"])
def test_service_stands_a_little_torture(tmp_path: Path, name: str) -> None:
    """Each outcome says itself what was asked and what was measured."""
    module = importlib.import_module(f"benchmarks.torture.{name}")

    outcomes = list(module.run(short=True, directory=tmp_path))

    assert outcomes
    failed = [f"{o.test}: asked {o.asked}, measured {o.measured}" for o in outcomes if not o.passed]
    assert failed == []
