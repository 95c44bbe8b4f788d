"""The page for operators against the code: settings, metrics, commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.metrics import Metrics
from app.settings import Settings

PAGE = (Path(__file__).parents[2] / "docs" / "operations.md").read_text(encoding="utf-8")


def default_of(name: str) -> str:
    """The default of a setting as the page writes it."""
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
    """Name, default and sentence as `app.settings` has them; the assertion shows the row to put."""
    description = Settings.model_fields[name].description
    row = f"| `MOTORID_{name.upper()}` | {default_of(name)} | {description} |"

    assert row in PAGE.splitlines()


def test_table_of_settings_has_no_other_row() -> None:
    """A setting that is gone is not documented."""
    rows = [line for line in PAGE.splitlines() if line.startswith("| `MOTORID_")]

    assert len(rows) == len(Settings.model_fields)


def test_every_metric_is_on_the_page() -> None:
    """Names as Prometheus shows them, from the registry itself."""
    families = Metrics().registry.collect()
    names = {f"{f.name}_total" if f.type == "counter" else f.name for f in families}

    assert len(names) >= 10
    assert {name for name in names if f"`{name}`" not in PAGE} == set()
