"""Names that the service gives: random, so that none can be guessed, and safe in a path.

new_id("run")            "run_5xk2...": 26 letters and digits, 130 bits
is_id("run", text)       whether a text could be one
"""

from __future__ import annotations

import re
import secrets
from typing import Literal

__all__ = ["Kind", "is_id", "new_id"]

Kind = Literal["run", "fit", "batch", "key"]

_ALPHABET = "abcdefghijklmnopqrstuvwxyz234567"
_LENGTH = 26
_FORM = re.compile(rf"[{_ALPHABET}]{{{_LENGTH}}}")


def new_id(kind: Kind) -> str:
    """A name that was never given before."""
    return f"{kind}_" + "".join(secrets.choice(_ALPHABET) for _ in range(_LENGTH))


def is_id(kind: Kind, text: str) -> bool:
    """Whether a text has the form of a name of this kind.

    Asked before a text from outside reaches the database or a path.
    """
    prefix, _, rest = text.partition("_")
    return prefix == kind and _FORM.fullmatch(rest) is not None
