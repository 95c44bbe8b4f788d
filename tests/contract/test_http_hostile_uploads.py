"""Malformed and hostile uploads: each has a defined error and leaves no file."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from tests.app.service import API, Caller, Server
from tests.contract.hostile import FILE, RUN, assert_is_problem, form, raw


@pytest.mark.usefixtures("nothing_left")
def test_upload_in_endless_chunks_is_refused(alice: Caller) -> None:
    """A body without Content-Length is counted while it arrives and stops at the limit."""

    def body() -> Iterator[bytes]:
        yield b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
        for _ in range(500):
            yield b"1,2,3,4,5\n" * 10_000

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    try:
        answer = alice.http.post("/runs", content=body(), headers=headers)
    except httpx.WriteError:
        # The server closed the connection after its response.
        answer = None

    if answer is not None:
        assert_is_problem(answer, 413)


FORMS = {
    "nothing": (b"", 400),
    "no part": (form(), 422),
    "no file": (form(('Content-Disposition: form-data; name="motor"', b"m")), 422),
    "two files": (form((FILE, RUN), (FILE, RUN)), 422),
    "half a form": (form((FILE, RUN), end=b""), 400),
    "no disposition": (form(("X: y", RUN)), 422),
    "no name": (form(("Content-Disposition: form-data", RUN)), 422),
    "a field too much": (form((FILE, RUN), ('Content-Disposition: form-data; name="x"', b"")), 422),
    "eleven parts": (form(*[('Content-Disposition: form-data; name="motor"', b"")] * 11), 422),
    "endless header": (form((f"X: {'y' * 100_000}", RUN)), 422),
    "no header end": (b"--b\r\n" + b"X" * 100_000, 422),
    "garbage": (b"\x00\xff" * 1000, 400),
    "NUL in the motor": (
        form((FILE, RUN), ('Content-Disposition: form-data; name="motor"', b"a\x00b")),
        422,
    ),
    "motor in no encoding": (
        form((FILE, RUN), ('Content-Disposition: form-data; name="motor"', b"\xff\xfe")),
        422,
    ),
    "endless motor": (
        form((FILE, RUN), ('Content-Disposition: form-data; name="motor"', b"m" * 201)),
        422,
    ),
    "endless mapping": (
        form((FILE, RUN), ('Content-Disposition: form-data; name="mapping"', b" " * 10_001)),
        422,
    ),
}


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize(("body", "status"), FORMS.values(), ids=FORMS.keys())
def test_malformed_form_is_refused(alice: Caller, body: bytes, status: int) -> None:
    """A body that is no form gives 400; invalid or too long fields give 422."""
    headers = {"Content-Type": "multipart/form-data; boundary=b"}

    assert_is_problem(alice.http.post("/runs", content=body, headers=headers), status)


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize(
    ("kind", "status"),
    [
        (None, 415),
        ("text/csv", 415),
        ("application/json", 415),
        ("multipart/mixed; boundary=b", 415),
        ("multipart/form-data", 400),
        ("multipart/form-data; boundary=", 400),
        ("multipart/form-data; boundary=" + "b" * 500, 400),
    ],
)
def test_upload_of_another_type_is_refused(alice: Caller, kind: str | None, status: int) -> None:
    """Another media type gives 415; a form without a valid boundary gives 400."""
    headers = {} if kind is None else {"Content-Type": kind}

    assert_is_problem(alice.http.post("/runs", content=form((FILE, RUN)), headers=headers), status)


MAPPINGS = [
    "{",
    "[]",
    "1",
    '"text"',
    '{"speed": 1}',
    '{"speed_rad_s": {"column": "no such column"}}',
    '{"speed_rad_s": {"column": "speed_rad_s", "unit": "furlong"}}',
    '{"speed_rad_s": {"column": "speed_rad_s", "scale": NaN}}',
    '{"speed_rad_s": {"column": "speed_rad_s", "scale": 0}}',
    '{"speed_rad_s": {"column": "speed_rad_s"}, "speed_rad_s": null}',
    '{"speed_rad_s": {"column": "speed_rad_s", "scael": 2}}',
    '{"a": ' * 1_500,
    "[" * 10_000,
    '{"speed_rad_s": {"column": "' + "s" * 9_000 + '"}}',
    '{"speed_rad_s": {"column": "' + "ä" * 33_000 + '"}}',
    '{"speed_rad_s": {"column": "' + "s" * 99_000 + '"}}',
]


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("mapping", MAPPINGS, ids=lambda text: text[:40])
def test_invalid_mapping_is_refused(alice: Caller, mapping: str) -> None:
    """The response is 422 for invalid JSON and for invalid content of a mapping."""
    answer = alice.http.post("/runs", files={"file": ("a.csv", RUN)}, data={"mapping": mapping})

    assert_is_problem(answer, 422)


@pytest.mark.usefixtures("nothing_left")
def test_interrupted_upload_leaves_nothing(server: Server, alice: Caller) -> None:
    """The client closes the connection before the announced end of the body."""
    head = (
        f"POST {API}/runs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 500000\r\n"
        f"Authorization: {alice.http.headers['authorization']}\r\n"
        "Content-Type: multipart/form-data; boundary=b\r\n\r\n"
    ).encode()

    raw(server, head, then=form((FILE, RUN), end=b""))

    assert httpx.get(f"{server.url}/readyz").status_code == 200
