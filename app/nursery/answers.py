"""Messages of a child of the fork server: one JSON object per line on the pipe."""

from __future__ import annotations

import json
import os
from typing import Any

__all__ = ["tell"]


def tell(answer: int, message: dict[str, Any]) -> None:
    """Write a message; if the pipe has no reader any more, exit without an error.

    Args:
        answer: Write end of the pipe.
        message: Object that JSON can represent.
    """
    line = json.dumps(message).encode() + b"\n"
    try:
        while line:
            line = line[os.write(answer, line) :]
    except BrokenPipeError:
        # The client has ended or abandoned the task; the fork server would kill this child anyway.
        os._exit(1)
