"""Static files of the pages: no external resources, media types, licences."""

from __future__ import annotations

import re
from pathlib import Path

import httpx
import pytest

from app.pages.rendering import STATIC_FILES
from tests.app.service import Caller, Server


def test_pages_refer_to_this_service_only(alice: Caller, server: Server) -> None:
    """Each URL in a page or script is local, and nothing is inline."""
    for path in ("/", "/docs", "/login"):
        page = httpx.get(server.url + path, headers=alice.http.headers).text
        for address in re.findall(r'(?:src|href|action)="([^"]*)"', page):
            assert address.startswith(("/", "#")), address
            assert not address.startswith("//")
        assert not re.search(r"<script(?![^>]*\bsrc=)", page)
        assert not re.search(r"<[^>]*\s(?:style|on\w+)=", page)
    for script in STATIC_FILES.glob("*.js"):
        assert "http://" not in script.read_text(encoding="utf-8")
        assert "https://" not in script.read_text(encoding="utf-8")


def test_static_files_of_the_pages_exist(alice: Caller, server: Server) -> None:
    """Styles and scripts return 200 without a key, with their media type."""
    kinds = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
    for path in ("/", "/docs", "/login"):
        page = httpx.get(server.url + path, headers=alice.http.headers).text
        named = re.findall(r'(?:src|href)="(/static/[^"]*)"', page)
        assert named
        for address in named:
            answer = httpx.get(server.url + address)
            assert answer.status_code == 200, address
            assert answer.headers["content-type"].startswith(kinds[Path(address).suffix])


@pytest.mark.parametrize(
    "path", ["/static/", "/static", "/static/../endpoints.py", "/static/%2e%2e/endpoints.py",
             "/static/..%2f..%2fmain.py", "/static/.hidden", "/static//etc/passwd"]
)  # fmt: skip
def test_only_static_files_are_served(server: Server, path: str) -> None:
    """Directories, hidden files and paths outside are not served."""
    assert httpx.get(server.url + path).status_code in (401, 404, 405)


def test_vendored_files_carry_their_licence() -> None:
    """swagger-ui is distributed under the Apache licence with its notice, htmx under 0BSD."""
    vendored = STATIC_FILES / "vendor"

    assert "Apache License" in (vendored / "swagger-ui" / "LICENSE").read_text(encoding="utf-8")
    assert (vendored / "swagger-ui" / "NOTICE").is_file()
    assert "Zero-Clause BSD" in (vendored / "htmx" / "LICENSE").read_text(encoding="utf-8")
