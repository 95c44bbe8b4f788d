"""Messages of a child of a fork server: one line of JSON each, on the pipe to the server."""

from __future__ import annotations

import json
import os
from typing import Any

__all__ = ["tell"]


def tell(answer: int, message: dict[str, Any]) -> None:
    """Write a message; where nobody reads the pipe any more, this process ends without a word.

    Args:
        answer: The pipe.
        message: What JSON can hold.
    """
    line = json.dumps(message).encode() + b"\n"
    try:
        while line:
            line = line[os.write(answer, line) :]
    except BrokenPipeError:
        # The server was ended, or has given the task up: the fork server ends this child too.
        os._exit(1)
