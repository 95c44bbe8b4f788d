"""Exports compiled once for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.export.c_code import c_code
from identification.export.model import exported_model
from tests.export.compiled import compiled
from tests.export.results import CASES, result_with


@pytest.fixture(scope="session")
def compiled_motors(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Shared library of each case."""
    return {
        name: compiled(
            c_code(exported_model(result_with(*effects)), [name]), tmp_path_factory.mktemp("c")
        )
        for name, effects in CASES.items()
    }
