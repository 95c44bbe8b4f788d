"""Outputs of a fit: sealed with their hashes, and compared with them when they are read."""

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
    """The directory of an attempt that succeeded."""
    for name, content in CONTENT.items():
        (tmp_path / name).write_bytes(content)
    seal(tmp_path)
    return tmp_path


def test_sealed_outputs_come_back_as_they_were_written(attempt: Path) -> None:
    """Byte by byte, and the sums are those of GNU coreutils."""
    for name, content in CONTENT.items():
        with open_output(attempt, name) as file:
            assert file.read() == content
    assert read_result(attempt) == {"parameters": {}}
    subprocess.run(["sha256sum", "--check", "SHA256SUMS"], cwd=attempt, check=True)


@pytest.mark.parametrize("name", CONTENT)
@pytest.mark.parametrize("damage", DAMAGES)
def test_output_that_is_not_what_was_written_is_not_opened(
    attempt: Path, name: str, damage: str
) -> None:
    """Whatever has become of it; the others open."""
    DAMAGES[damage](attempt / name)

    with pytest.raises(OSError):  # noqa: PT011  each damage has an error of its own
        open_output(attempt, name)
    for other in CONTENT.keys() - {name}:
        open_output(attempt, other).close()


def test_output_without_permission_is_an_error_of_the_system(
    attempt: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pretended, since the permissions of a file do not bind root."""

    def refuse(path: Path) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(outputs, "open_regular", refuse)

    with pytest.raises(PermissionError):
        read_result(attempt)


@pytest.mark.parametrize("damage", DAMAGES)
def test_sums_that_are_lost_lose_no_output(attempt: Path, damage: str) -> None:
    """What cannot be compared is given as it is."""
    DAMAGES[damage](attempt / "SHA256SUMS")

    assert read_result(attempt) == {"parameters": {}}


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "[" * 100_000, '{"a": "\udcff"}'])
def test_result_without_sums_is_at_least_an_object(attempt: Path, text: str) -> None:
    """A result of an older version has no sums."""
    (attempt / "SHA256SUMS").unlink()
    (attempt / "result.json").write_bytes(text.encode("utf-8", "surrogateescape"))

    with pytest.raises(OSError, match=r"Not JSON|No result"):
        read_result(attempt)


def test_sums_say_which_outputs_there_have_to_be(attempt: Path) -> None:
    """A fit without a posterior has two; every fit has a result and a report."""
    assert expected_outputs(attempt) == CONTENT.keys()
    (attempt / "posterior.nc").unlink()
    seal(attempt)
    assert expected_outputs(attempt) == CONTENT.keys() - {"posterior.nc"}
    (attempt / "SHA256SUMS").unlink()
    assert expected_outputs(attempt) == CONTENT.keys() - {"posterior.nc"}
