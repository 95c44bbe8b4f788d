"""Shared fixture of the tests of reports: a result that may be changed."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from tests.reports import make_report


@pytest.fixture
def result() -> dict[str, Any]:
    """Modifiable result of the motor without additional effects."""
    copied: dict[str, Any] = copy.deepcopy(dict(make_report(rows=300).result))
    return copied
