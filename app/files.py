"""Answers that are files: each is whole.

A file is opened before the first byte of its answer is sent.  From then on it may lose its name, as
when its fit is removed at that moment, and keeps its bytes until the last of them is sent.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import BinaryIO

from starlette.responses import FileResponse
from starlette.types import Receive, Scope, Send

__all__ = ["OpenFileResponse"]


class OpenFileResponse(FileResponse):
    """Sends a file that is open already, or the part of it that a Range header asks for.

    Args:
        file: The file; it is closed at the end.
        media_type: What it is.
        filename: Under which name a browser saves it; where there is none, it shows it.
        headers: Further headers.
    """

    def __init__(
        self,
        file: BinaryIO,
        *,
        media_type: str,
        filename: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(
            # Names what is open, whatever has become of the name under which it was opened.
            f"/dev/fd/{file.fileno()}",
            headers=headers,
            media_type=media_type,
            filename=filename,
            stat_result=os.fstat(file.fileno()),
        )
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        with self._file:
            await super().__call__(scope, receive, send)
