"""Answers that are files: each is whole, or a problem.

A file is opened before the first byte of its answer is sent.  From then on it may lose its name, as
when its fit is removed at that moment, and keeps its bytes until the last of them is sent.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import BinaryIO

from starlette.datastructures import Headers
from starlette.responses import FileResponse
from starlette.staticfiles import StaticFiles
from starlette.types import Message, Receive, Scope, Send

from app.errors import BadRequest, RangeOutside

__all__ = ["OpenFileResponse", "PageFiles"]


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
        """Send it.

        Raises:
            BadRequest: The Range header cannot be understood.
            RangeOutside: It asks for bytes that the file does not have.
        """
        with self._file:
            await super().__call__(scope, receive, _refusing(send))


class PageFiles(StaticFiles):
    """The files of the pages; a bad Range header is refused as with any other file."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one of them."""
        await super().__call__(scope, receive, _refusing(send))


def _refusing(send: Send) -> Send:
    """Turn the framework's plain refusal of a Range header into an error that becomes a problem."""

    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            status, headers = message["status"], Headers(raw=message["headers"])
            if status == 400:
                raise BadRequest("the Range header cannot be read; expected `bytes=FIRST-LAST`")
            if status == 416:
                raise RangeOutside(headers["content-range"])
        await send(message)

    return answer
