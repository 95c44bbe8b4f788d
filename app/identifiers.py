"""Random identifiers, unguessable and safe in a path.

new_id("run")            "run_5xk2...": 26 letters and digits, 130 bits
is_id("run", text)       True if the text has this form
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
    """New random identifier."""
    return f"{kind}_" + "".join(secrets.choice(_ALPHABET) for _ in range(_LENGTH))


def is_id(kind: Kind, text: str) -> bool:
    """Return True if a text has the form of an identifier of this kind.

    Call before an external text reaches the database or a path.
    """
    prefix, _, rest = text.partition("_")
    return prefix == kind and _FORM.fullmatch(rest) is not None
