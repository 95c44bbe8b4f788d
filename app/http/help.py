"""Documentation site under /help: static pages with a content security policy of their own.

The theme of the pages has a few inline scripts.  The policy admits exactly those, by their hashes,
and a style attribute of an element; everything else comes from this service.
"""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

from starlette.datastructures import MutableHeaders
from starlette.types import Message, Receive, Scope, Send

from app.http.files import PageFiles
from app.http.headers import STATIC_CACHE

__all__ = ["HelpPages", "help_policy"]

_INLINE = re.compile(r"<script>(.*?)</script>", re.DOTALL)


class HelpPages(PageFiles):
    """Pages of the documentation site, which `make docs-site` has written."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory=directory, html=True)
        self._policy = help_policy(directory)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one page or one of its files."""

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Content-Security-Policy"] = self._policy
                headers["Cache-Control"] = STATIC_CACHE
            await send(message)

        await super().__call__(scope, receive, answer)


def help_policy(directory: Path) -> str:
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
