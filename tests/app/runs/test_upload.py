"""Streaming parser of upload forms."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.errors import BadRequest, BodyTooLarge, FieldRefused, WrongMediaType
from app.runs.upload import Upload, UploadForm, boundary_of, label

CONTENT = b"time_s,voltage_V\r\n0,1\r\n--b\r\n\r\n--boundar\r\n" + bytes(range(256))


def body(content: bytes = CONTENT) -> bytes:
    """Form with a motor and a file."""
    return (
        b'--boundary\r\nContent-Disposition: form-data; name="motor"\r\n\r\nmotor 17\r\n'
        b'--boundary\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n'
        b"Content-Type: text/csv\r\n\r\n" + content + b"\r\n--boundary--\r\n"
    )


def received(target: Path, content: bytes, limit: int = 10_000) -> Upload:
    """Upload from a body that arrives as a whole."""
    with UploadForm(b"boundary", target, limit) as form:
        form.feed(content)
        return form.finish()


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.lists(st.integers(0, len(body())), max_size=8), number=st.integers(0, 10**9))
def test_form_does_not_depend_on_the_chunks(tmp_path: Path, cuts: list[int], number: int) -> None:
    """Bytes, hash, size, name and fields are the same for any division into chunks."""
    target = tmp_path / f"{number}"
    target.unlink(missing_ok=True)
    ends = sorted({0, *cuts, len(body())})

    with UploadForm(b"boundary", target, limit=10_000) as form:
        for start, end in zip(ends, ends[1:], strict=False):
            form.feed(body()[start:end])
        upload = form.finish()

    assert target.read_bytes() == CONTENT
    assert upload.sha256 == hashlib.sha256(CONTENT).hexdigest()
    assert (upload.size, upload.name) == (len(CONTENT), "a.csv")
    assert upload.fields == {"motor": "motor 17"}


@pytest.mark.parametrize("end", range(0, len(body()) - 2, 7))
def test_truncated_form_leaves_no_file(tmp_path: Path, end: int) -> None:
    """A form truncated at any seventh byte is rejected."""
    with pytest.raises(BadRequest, match="the form is incomplete"):
        received(tmp_path / "x", body()[:end])

    assert list(tmp_path.iterdir()) == []


def test_limit_is_exact(tmp_path: Path) -> None:
    """A file of 100 bytes passes a limit of 100; one of 101 is rejected and removed."""
    assert received(tmp_path / "x", body(b"x" * 100), limit=100).size == 100

    with pytest.raises(BodyTooLarge, match="more than 100 bytes"):
        received(tmp_path / "y", body(b"x" * 101), limit=100)

    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_file_is_private(tmp_path: Path) -> None:
    """Only the owner can read an uploaded file."""
    received(tmp_path / "x", body())

    assert (tmp_path / "x").stat().st_mode & 0o777 == 0o600


def test_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    """The target is created exclusively."""
    (tmp_path / "x").write_text("someone's")

    with pytest.raises(FileExistsError):
        UploadForm(b"boundary", tmp_path / "x", limit=100)

    assert (tmp_path / "x").read_text() == "someone's"


def test_unknown_field_is_refused(tmp_path: Path) -> None:
    """A misspelt `mapping` would otherwise be ignored silently."""
    with pytest.raises(FieldRefused, match="unknown field; expected file, motor, mapping"):
        received(tmp_path / "x", body().replace(b'name="motor"', b'name="mappings"'))


def fed(target: Path, content: bytes, step: int) -> None:
    """Parse a body that arrives in chunks of this size [bytes]."""
    with UploadForm(b"boundary", target, limit=10_000) as form:
        for start in range(0, len(content), step):
            form.feed(content[start : start + step])


@pytest.mark.parametrize("step", [7, 100_000])
def test_long_name_of_a_file_is_refused_with_the_limit(tmp_path: Path, step: int) -> None:
    """A header has at most 4000 bytes, whether it arrives in many chunks or in one."""
    content = body().replace(b"a.csv", b"a" * 5000 + b".csv")

    with pytest.raises(FieldRefused, match="at most 4000; shorten the name"):
        fed(tmp_path / "x", content, step)

    assert list(tmp_path.iterdir()) == []


def test_quotation_mark_in_a_name_is_as_the_browser_received_it(tmp_path: Path) -> None:
    """WHATWG HTML, multipart/form-data encoding: a browser sends a quotation mark as %22."""
    sent = body().replace(b"a.csv", b"a %22quoted%22 run, 100 %25.csv")

    assert received(tmp_path / "x", sent).name == 'a "quoted" run, 100 %25.csv'


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        ("run.csv", "run.csv"),
        ("../../etc/passwd", "passwd"),
        ("C:\\bench\\run 3.csv", "run 3.csv"),
        ("/", "run"),
        ("", "run"),
        (
            "a\x00b\r\n.csv",
            "a\ufffdb\ufffd\ufffd.csv",
        ),
        ("ü" * 300 + ".csv", "ü" * 196 + ".csv"),
    ],
)
def test_name_of_a_file_becomes_a_label(sent: str, shown: str) -> None:
    """The label is the last component, printable, with its suffix, at most 200 characters."""
    assert label(sent) == shown


@pytest.mark.parametrize(
    ("kind", "boundary"),
    [
        ("multipart/form-data; boundary=abc", b"abc"),
        ('Multipart/Form-Data; charset=utf-8; boundary="a b"', b"a b"),
    ],
)
def test_boundary_is_read_from_the_content_type(kind: str, boundary: bytes) -> None:
    """RFC 2046: the type in any case, other parameters, the boundary quoted or not."""
    assert boundary_of(kind) == boundary


@pytest.mark.parametrize("kind", ["", "text/csv", "multipart/mixed; boundary=x", ";"])
def test_other_media_type_is_refused(kind: str) -> None:
    """The error names the expected media type."""
    with pytest.raises(WrongMediaType, match="expected multipart/form-data"):
        boundary_of(kind)
