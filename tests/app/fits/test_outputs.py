"""Output files of a fit: sealed with checksums that every read verifies."""

from __future__ import annotations

import errno
import os
import subprocess
from pathlib import Path

import pytest

from app.fits import outputs
from app.fits.outputs import expected_outputs, open_output, read_result, seal
from tests.app.damaged import DAMAGES

CONTENT = {"result.json": b'{"parameters": {}}', "report.html": b"<p>x", "posterior.nc": b"CDF"}


@pytest.fixture
def attempt(tmp_path: Path) -> Path:
    """Directory of a successful attempt."""
    for name, content in CONTENT.items():
        (tmp_path / name).write_bytes(content)
    seal(tmp_path)
    return tmp_path


def test_sealed_outputs_are_read_unchanged(attempt: Path) -> None:
    """GNU coreutils can verify the checksum file."""
    for name, content in CONTENT.items():
        with open_output(attempt, name) as file:
            assert file.read() == content
    assert read_result(attempt) == {"parameters": {}}
    subprocess.run(["sha256sum", "--check", "SHA256SUMS"], cwd=attempt, check=True)


@pytest.mark.parametrize("name", CONTENT)
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_output_is_not_opened(attempt: Path, name: str, damage: str) -> None:
    """The other outputs can still be opened."""
    DAMAGES[damage](attempt / name)

    with pytest.raises(OSError):  # noqa: PT011  each damage causes a different error
        open_output(attempt, name)
    for other in CONTENT.keys() - {name}:
        open_output(attempt, other).close()


def test_unreadable_output_is_an_os_error(attempt: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error is simulated, because file permissions do not apply to root."""

    def refuse(path: Path) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(outputs, "open_regular", refuse)

    with pytest.raises(PermissionError):
        read_result(attempt)


@pytest.mark.parametrize("damage", DAMAGES)
def test_lost_checksums_lose_no_output(attempt: Path, damage: str) -> None:
    """Without a readable checksum file, outputs are read without verification."""
    DAMAGES[damage](attempt / "SHA256SUMS")

    assert read_result(attempt) == {"parameters": {}}


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "[" * 100_000, '{"a": "\udcff"}'])
def test_result_without_checksums_must_be_a_json_object(attempt: Path, text: str) -> None:
    """Results of older versions have no checksums."""
    (attempt / "SHA256SUMS").unlink()
    (attempt / "result.json").write_bytes(text.encode("utf-8", "surrogateescape"))

    with pytest.raises(OSError, match=r"Not JSON|No result"):
        read_result(attempt)


def test_checksums_list_the_expected_outputs(attempt: Path) -> None:
    """Result and report are always expected, the posterior only if the checksums list it."""
    assert expected_outputs(attempt) == CONTENT.keys()
    (attempt / "posterior.nc").unlink()
    seal(attempt)
    assert expected_outputs(attempt) == CONTENT.keys() - {"posterior.nc"}
    (attempt / "SHA256SUMS").unlink()
    assert expected_outputs(attempt) == CONTENT.keys() - {"posterior.nc"}
