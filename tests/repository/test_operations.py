"""The operations page agrees with the settings, metrics and commands of the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.metrics import Metrics
from app.settings import Settings

PAGE = (Path(__file__).parents[2] / "docs" / "operations.md").read_text(encoding="utf-8")


def default_of(name: str) -> str:
    """Default of a setting in the notation of the page."""
    field = Settings.model_fields[name]
    if field.default_factory is not None:
        return "number of cores"
    value = field.default
    if value is None or value == ():
        return "empty"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return str(int(value)) if value == int(value) else str(value)
    return f"`{value}`"


@pytest.mark.parametrize("name", Settings.model_fields)
def test_table_of_settings_has_this_row(name: str) -> None:
    """Name, default and description are those of `app.settings`; the failure shows the row."""
    description = " ".join((Settings.model_fields[name].description or "").split())
    row = f"| `MOTORID_{name.upper()}` | {default_of(name)} | {description} |"

    assert row in PAGE.splitlines()


def test_table_of_settings_has_no_other_row() -> None:
    """A removed setting must not be documented."""
    rows = [line for line in PAGE.splitlines() if line.startswith("| `MOTORID_")]

    assert len(rows) == len(Settings.model_fields)


def test_every_metric_is_on_the_page() -> None:
    """Reference: the metric names of the Prometheus registry."""
    families = Metrics().registry.collect()
    names = {f"{f.name}_total" if f.type == "counter" else f.name for f in families}

    assert len(names) >= 10
    assert {name for name in names if f"`{name}`" not in PAGE} == set()
