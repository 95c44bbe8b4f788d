"""File responses: either complete, or a problem response.

The file is opened before the first byte of the response.  If it is deleted meanwhile, as when its
fit is removed, the open file still supplies all bytes.
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
    """Response that sends an open file, or the part requested by a Range header, and closes it.

    Without a file name the browser displays the content.
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
            # Path of the open descriptor, valid even if the file has been deleted.
            f"/dev/fd/{file.fileno()}",
            headers=headers,
            media_type=media_type,
            filename=filename,
            stat_result=os.fstat(file.fileno()),
        )
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file.

        Raises:
            BadRequest: The Range header is malformed.
            RangeOutside: The Range header asks for bytes outside the file.
        """
        with self._file:
            await super().__call__(scope, receive, _refusing(send))


class PageFiles(StaticFiles):
    """Static files of the web pages; a bad Range header gives a problem response."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one static file."""
        await super().__call__(scope, receive, _refusing(send))


def _refusing(send: Send) -> Send:
    """Convert the framework's plain Range errors into exceptions of the service."""

    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            status, headers = message["status"], Headers(raw=message["headers"])
            if status == 400:
                raise BadRequest("the Range header cannot be read; expected `bytes=FIRST-LAST`")
            if status == 416:
                raise RangeOutside(headers["content-range"])
        await send(message)

    return answer
