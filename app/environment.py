"""Detection of unknown MOTORID_ environment variables."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from app.settings import Settings

__all__ = ["unknown_variables"]

# Variables of other commands, and the directory of the settings files.
_OTHERS = ("MOTORID_CACHE", "MOTORID_KEY", "MOTORID_SECRETS_DIR", "MOTORID_TRACEBACK")


def unknown_variables(names: Iterable[str]) -> dict[str, str]:
    """Unknown names with the prefix MOTORID_, each with the most similar known name.

    Args:
        names: Names of the environment variables.
    """
    known = [*(f"MOTORID_{name.upper()}" for name in Settings.model_fields), *_OTHERS]
    unknown = [
        name for name in names if name.upper().startswith("MOTORID_") and name.upper() not in known
    ]
    return {name: difflib.get_close_matches(name.upper(), known, 1, 0.0)[0] for name in unknown}
