"""File responses, either complete or a problem response, and the documentation site under /help.

The file is opened before the first byte of the response.  If it is deleted meanwhile, as when its
fit is removed, the open file still supplies all bytes.

The theme of the documentation has a few inline scripts.  The policy of its pages admits exactly
those, by their hashes, and a style attribute of an element; all else comes from this service.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from pathlib import Path
from typing import Any, BinaryIO

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import FileResponse
from starlette.staticfiles import StaticFiles
from starlette.types import Message, Receive, Scope, Send

from app.errors import BadRequest, RangeOutside
from app.http.headers import STATIC_CACHE

__all__ = ["HelpPages", "OpenFileResponse", "PageFiles"]

_INLINE = re.compile(r"<script>(.*?)</script>", re.DOTALL)


class OpenFileResponse(FileResponse):
    """Response that sends an open file, or the part requested by a Range header, and closes it.

    The options are those of `FileResponse`; without a file name the browser displays the content.
    """

    def __init__(self, file: BinaryIO, **options: Any) -> None:
        # The path of the open descriptor is valid even if the file has been deleted.
        path = f"/dev/fd/{file.fileno()}"
        super().__init__(path, stat_result=os.fstat(file.fileno()), **options)
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file; raise `BadRequest` or `RangeOutside` for a Range header at fault."""
        with self._file:
            await super().__call__(scope, receive, _refusing(send))


class PageFiles(StaticFiles):
    """Static files of the web pages; a bad Range header gives a problem response."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one static file."""
        await super().__call__(scope, receive, _refusing(send))


class HelpPages(PageFiles):
    """Pages of the documentation site, which `make docs-site` has written."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory=directory, html=True)
        self._policy = _help_policy(directory)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one page or one of its files."""

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Content-Security-Policy"] = self._policy
                headers["Cache-Control"] = STATIC_CACHE
            await send(message)

        await super().__call__(scope, receive, answer)


def _help_policy(directory: Path) -> str:
    """Content security policy that admits the inline scripts of the pages of a directory."""
    scripts = {
        script
        for page in directory.rglob("*.html")
        for script in _INLINE.findall(page.read_text(encoding="utf-8"))
    }
    hashes = sorted(
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts
    )
    admitted = " ".join(["'self'", *(f"'sha256-{digest}'" for digest in hashes)])
    return (
        f"default-src 'none'; script-src {admitted}; style-src 'self'; "
        "style-src-attr 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; "
        "worker-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
    )


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
