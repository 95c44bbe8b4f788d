"""Mappings of columns that errors give as examples of a remedy."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

__all__ = ["Example", "as_json", "of_file"]

Example = Mapping[str, object]
"""Mapping of columns to channels: ``{"speed_rad_s": {"column": "n", "unit": "rpm"}}``."""


def of_file(file: str, example: Example) -> Example:
    """The mapping restricted to one file, as a fault in its cells may not be one of other files."""
    return {"files": {file: example}}


def as_json(examples: Sequence[Example]) -> str:
    """Text of alternative mappings as JSON."""
    shown = (json.dumps(example, ensure_ascii=False) for example in examples)
    return f"a mapping such as {' or '.join(shown)}"
