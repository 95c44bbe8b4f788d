"""File responses, sent to a client within the process."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest

from app.errors import BadRequest, RangeOutside
from app.http.files import OpenFileResponse

CONTENT = bytes(range(256)) * 1000
"""Content larger than one read block."""


def sent(response: OpenFileResponse, **headers: str) -> httpx.Response:
    """Response that a client receives."""

    async def get() -> httpx.Response:
        """Send one request."""
        transport = httpx.ASGITransport(app=response)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.get("/", headers=headers)

    return asyncio.run(get())


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """File with the test content."""
    path = tmp_path / "draws"
    path.write_bytes(CONTENT)
    return path


@pytest.fixture
def response(path: Path) -> OpenFileResponse:
    """File response for the test file."""
    return OpenFileResponse(path.open("rb"), media_type="application/x-netcdf", filename="a.nc")


def test_file_deleted_meanwhile_is_sent_completely(path: Path, response: OpenFileResponse) -> None:
    """The open file is sent, although its path now names another file."""
    path.unlink()
    path.write_bytes(b"another")

    answer = sent(response)

    assert answer.content == CONTENT
    assert answer.headers["content-length"] == str(len(CONTENT))
    assert answer.headers["content-disposition"] == 'attachment; filename="a.nc"'
    assert answer.headers["content-type"] == "application/x-netcdf"
    assert answer.headers["etag"]
    assert answer.headers["last-modified"]
    assert response._file.closed


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("bytes=0-3", CONTENT[:4]),
        ("bytes=-5", CONTENT[-5:]),
        ("bytes=255999-", CONTENT[-1:]),
        ("bytes=10-999999", CONTENT[10:]),
    ],
)
def test_range_of_a_file_deleted_meanwhile_is_sent(
    path: Path, response: OpenFileResponse, asked: str, expected: bytes
) -> None:
    """The response is 206 with the requested bytes."""
    path.unlink()

    answer = sent(response, Range=asked)

    assert (answer.status_code, answer.content) == (206, expected)


@pytest.mark.parametrize("asked", ["bytes", "bytes=", "bytes=x-y", "lines=1-2", "bytes=5-2", "=,"])
def test_malformed_range_is_refused(response: OpenFileResponse, asked: str) -> None:
    """The error is raised before anything is sent, and the file is closed."""
    with pytest.raises(BadRequest, match="expected `bytes=FIRST-LAST`"):
        sent(response, Range=asked)

    assert response._file.closed


@pytest.mark.parametrize("asked", ["bytes=256000-", "bytes=9999999-99999999", "bytes=-0"])
def test_range_outside_the_file_is_refused(response: OpenFileResponse, asked: str) -> None:
    """The error gives the size of the file."""
    with pytest.raises(RangeOutside, match="expected a range within its 256000 bytes") as refusal:
        sent(response, Range=asked)

    assert refusal.value.content_range == "bytes */256000"
    assert response._file.closed
