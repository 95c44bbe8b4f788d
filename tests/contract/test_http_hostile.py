"""Broken and hostile requests: each has its named answer, none a 500, nothing is left behind."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

import httpx
import pytest

from tests.app.service import API, Caller, Server, run_text

UNKNOWN = "run_" + "a" * 26
JSON = {"Content-Type": "application/json"}
DEEP = "[" * 50_000 + "]" * 50_000


def assert_is_problem(answer: httpx.Response, *statuses: int) -> None:
    """A refusal with its form, its code and nothing of the inside of the service."""
    assert answer.status_code in statuses, (answer.status_code, answer.text[:500])
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == answer.status_code
    assert {"type", "title", "detail", "code", "request_id"} <= problem.keys()
    assert "Traceback" not in answer.text
    assert "site-packages" not in answer.text


@pytest.fixture
def nothing_left(server: Server) -> Iterator[None]:
    """The data directory has the same runs and no incoming file afterwards."""
    before = sorted((server.data_dir / "runs").iterdir())
    yield
    assert sorted((server.data_dir / "runs").iterdir()) == before
    assert [path for path in server.data_dir.rglob("incoming/*/*")] == []


BODIES = {
    "nothing": (b"", 422),
    "no json": (b"{training: [1]}", 400),
    "half json": (b'{"training": ["', 400),
    "no utf-8": (b'{"training": ["\xff\xfe"]}', 400),
    "deep": (DEEP.encode(), 400),
    "a list": (b"[]", 422),
    "a number": (b"1", 422),
    "null": (b"null", 422),
    "no training": (b"{}", 422),
    "empty training": (b'{"training": []}', 422),
    "training is text": (f'{{"training": "{UNKNOWN}"}}'.encode(), 422),
    "training of numbers": (b'{"training": [1, 2]}', 422),
    "training of lists": (b'{"training": [["a"]]}', 422),
    "unknown run": (f'{{"training": ["{UNKNOWN}"]}}'.encode(), 404),
    "no id": (b'{"training": ["../../etc/passwd"]}', 404),
    "NUL in an id": (b'{"training": ["run_\\u0000"]}', 404),
    "half a surrogate": (b'{"training": ["\\ud800"]}', 422),
    "an endless id": (json.dumps({"training": ["x" * 5000]}).encode(), 422),
    "too many runs": (json.dumps({"training": [UNKNOWN] * 201}).encode(), 422),
    "a field too much": (f'{{"training": ["{UNKNOWN}"], "x": 1}}'.encode(), 422),
    "an endless number": (b'{"training": [' + b"9" * 10_000 + b"]}", 400),
}


@pytest.mark.parametrize(("body", "status"), BODIES.values(), ids=BODIES.keys())
def test_broken_request_for_a_fit_is_refused(alice: Caller, body: bytes, status: int) -> None:
    """400 what is no JSON, 422 what has the wrong form, 404 what names no run."""
    assert_is_problem(alice.http.post("/fits", content=body, headers=JSON), status)


OPTIONS = [
    {"seed": -1},
    {"seed": 2**32},
    {"seed": 10**400},
    {"seed": "0"},
    {"seed": 1.5},
    {"seed": True},
    {"posterior": "yes"},
    {"posterior": 1},
    {"hold": "spline"},
    {"hold": None},
    {"temperatures": []},
    {"temperatures": [25.0] * 21},
    {"temperatures": ["warm"]},
    {"temperatures": [-400.0]},
    {"temperatures": [1e308]},
    {"controllers": []},
    {"controllers": ["X:1"]},
    {"controllers": ["P:"]},
    {"controllers": ["P:nan"]},
    {"controllers": ["PID:1"]},
    {"controllers": ["P:" + "1" * 200]},
    {"controllers": "P:1"},
    {"Seed": 1},
    {"pipeline": "os:system"},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: str(options)[:40])
def test_option_that_is_not_accepted_is_named(
    alice: Caller, stored: str, options: dict[str, object]
) -> None:
    """422, and the words say which option it is about."""
    body = json.dumps({"training": [stored], "options": options})

    answer = alice.http.post("/fits", content=body, headers=JSON)

    assert_is_problem(answer, 422, 400)
    if answer.status_code == 422:
        assert next(iter(options)).rstrip("s") in answer.text


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_number_that_is_not_finite_is_refused(alice: Caller, stored: str, number: str) -> None:
    """JSON has none; Python's reader takes some of them, and the service must not."""
    body = f'{{"training": ["{stored}"], "options": {{"temperatures": [{number}]}}}}'

    assert_is_problem(alice.http.post("/fits", content=body, headers=JSON), 422, 400)


def test_run_in_two_roles_is_refused(alice: Caller, stored: str) -> None:
    """Whoever checks on what was fitted fools himself."""
    for body in ({"training": [stored, stored]}, {"training": [stored], "validation": [stored]}):
        answer = alice.http.post("/fits", json=body)

        assert_is_problem(answer, 422)
        assert "twice" in answer.json()["detail"]


@pytest.mark.parametrize("key", ["", "a b", "x" * 256, "naïve", "tab\there"])
def test_idempotency_key_that_is_no_word_is_refused(alice: Caller, stored: str, key: str) -> None:
    """1 to 255 visible ASCII characters."""
    headers = {"Idempotency-Key": key.encode("latin-1")}

    answer = alice.http.post("/fits", json={"training": [stored]}, headers=headers)  # type: ignore[arg-type]

    assert_is_problem(answer, 422)
    assert "Idempotency-Key" in answer.json()["detail"]


@pytest.mark.parametrize("path", ["/fits", "/batches"])
@pytest.mark.parametrize(
    "kind", [None, "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"]
)
def test_body_of_another_type_is_refused(
    alice: Caller, stored: str, path: str, kind: str | None
) -> None:
    """415: a page of another site can send these types without asking, JSON it cannot."""
    headers = {} if kind is None else {"Content-Type": kind}
    body = json.dumps({"training": [stored]}).encode()

    assert_is_problem(alice.http.post(path, content=body, headers=headers), 415)


def test_json_above_the_limit_is_refused_however_it_is_sent(alice: Caller) -> None:
    """413 announced, and 413 in chunks of unknown number; the test server takes 100,000 bytes."""
    body = b'{"training": ["' + b"x" * 200_000 + b'"]}'

    announced = alice.http.post("/fits", content=body, headers=JSON)
    in_chunks = alice.http.post("/fits", content=iter([body[:1000], body[1000:]]), headers=JSON)

    assert_is_problem(announced, 413)
    assert_is_problem(in_chunks, 413)


@pytest.mark.usefixtures("nothing_left")
def test_upload_in_endless_chunks_is_refused(alice: Caller) -> None:
    """A body without an announced length is counted as it comes; it stops at the limit."""

    def body() -> Iterator[bytes]:
        yield b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
        for _ in range(500):
            yield b"1,2,3,4,5\n" * 10_000

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    try:
        answer = alice.http.post("/runs", content=body(), headers=headers)
    except httpx.WriteError:
        # The server hung up on what it had refused.
        answer = None

    if answer is not None:
        assert_is_problem(answer, 413)


def form(*parts: tuple[str, bytes], end: bytes = b"--b--\r\n") -> bytes:
    """A form written by hand: the header of each part and its content."""
    return (
        b"".join(
            b"--b\r\n" + head.encode("utf-8", "surrogateescape") + b"\r\n\r\n" + content + b"\r\n"
            for head, content in parts
        )
        + end
    )


FILE = 'Content-Disposition: form-data; name="file"; filename="a.csv"'
RUN = run_text(99)
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
    "endless header": (form((f"X: {'y' * 100_000}", RUN)), 400),
    "no header end": (b"--b\r\n" + b"X" * 100_000, 400),
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
        form((FILE, RUN), ('Content-Disposition: form-data; name="mapping"', b" " * 100_001)),
        413,
    ),
}


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize(("body", "status"), FORMS.values(), ids=FORMS.keys())
def test_broken_form_is_refused(alice: Caller, body: bytes, status: int) -> None:
    """400 what is no form, 422 what has the wrong fields, 413 what is too large."""
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
    """415 another kind of body, 400 a form that cannot be taken apart."""
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
    '{"a": ' * 15_000,
    "[" * 50_000,
]


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("mapping", MAPPINGS, ids=lambda text: text[:40])
def test_mapping_that_is_not_accepted_is_refused(alice: Caller, mapping: str) -> None:
    """422, whether it is no JSON or says what cannot be."""
    answer = alice.http.post("/runs", files={"file": ("a.csv", RUN)}, data={"mapping": mapping})

    assert_is_problem(answer, 422)


NAMES = [
    "../../../etc/passwd",
    "..\\..\\windows\\system32",
    "/etc/passwd",
    "C:\\run.csv",
    "%2e%2e%2frun.csv",
    "%252e%252e%252f",
    "run.csv\x00.txt",
    "....//....//run",
    ".",
    "..",
    "",
    "~root",
    "|id",
    "$(id).csv",
    "run\r\nX-Injected: 1.csv",
    "a" * 5000 + ".csv",
    "\u202egpj.csv",
    "con",
    "\U0001f600.csv",
    "<script>alert(1)</script>.csv",
]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:30])
def test_name_of_a_file_is_a_label_and_never_a_path(
    alice: Caller, server: Server, name: str
) -> None:
    """The bytes lie under the id that the service gave; the label has no directory."""
    content = run_text(1000 + NAMES.index(name))
    escaped = name.replace("\r", "%0D").replace("\n", "%0A")
    head = f'Content-Disposition: form-data; name="file"; filename="{escaped}"'
    before = {path for path in server.data_dir.rglob("*") if path.is_file()}

    answer = alice.http.post(
        "/runs",
        content=form((head, content)),
        headers={"Content-Type": "multipart/form-data; boundary=b"},
    )

    if answer.status_code != 201:
        assert_is_problem(answer, 400, 422)
        return
    run = answer.json()
    new = {path for path in server.data_dir.rglob("*") if path.is_file()} - before
    assert {p for p in new if "journal" not in p.name} == {server.data_dir / "runs" / run["id"]}
    assert "/" not in run["file"]
    assert "\\" not in run["file"]
    assert run["file"].isprintable()
    assert 0 < len(run["file"]) <= 200


PATHS = [
    "/runs/..%2f..%2fetc%2fpasswd",
    "/runs/%00",
    "/runs/run_%00",
    "/runs/" + "a" * 3000,
    "/runs/%ff%fe",
    "/runs/" + UNKNOWN,
    "/runs/" + UNKNOWN.upper(),
    "/fits/fit_" + "a" * 26,
    "/fits/" + UNKNOWN,
    "/fits/x/report",
    "/fits/..%2f..%2f/posterior",
    "/fits/%F0%9F%98%80/events",
    "/batches/1",
    "/batches/batch_" + "z" * 26,
    "/runs/'%20OR%201=1",
    "/nothing",
    "/runs/a/b/c",
]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path[:40])
def test_what_is_not_there_is_not_found(alice: Caller, path: str) -> None:
    """404 as a problem, for reading and for deleting."""
    assert_is_problem(alice.http.get(path), 404)
    assert_is_problem(alice.http.delete(path), 404, 405)


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("PUT", "/runs"),
        ("PATCH", "/fits"),
        ("DELETE", "/fits"),
        ("POST", "/healthz"),
        ("X", "/runs"),
    ],
)
def test_method_that_an_address_does_not_take_is_refused(
    alice: Caller, method: str, path: str
) -> None:
    """405, and the answer says which methods it takes."""
    answer = alice.http.request(method, path)

    assert_is_problem(answer, 405)
    assert answer.headers["allow"]


@pytest.mark.parametrize(
    "query",
    [
        "limit=0",
        "limit=1001",
        "limit=-1",
        "limit=many",
        "limit=" + "9" * 5000,
        "after=x",
        "after=%00",
        "after=bm9uZQ",
        "after=" + "A" * 200,
        "after=aW5mIHg",
        "motor=" + "m" * 201,
    ],
    ids=lambda query: query[:20],
)
def test_query_that_is_not_accepted_is_refused(alice: Caller, query: str) -> None:
    """422 for a page of no length and for positions that were never given."""
    assert_is_problem(alice.http.get(f"/runs?{query}"), 422)


def test_batch_of_no_motor_and_of_too_many_is_refused(alice: Caller, stored: str) -> None:
    """1 to 1000 motors, in a body of the size that is taken."""
    assert_is_problem(alice.http.post("/batches", json={"motors": []}), 422)
    many = {"motors": [{"training": ["r"]}] * 1001}
    assert_is_problem(alice.http.post("/batches", json=many), 422)


def raw(server: Server, request: bytes, *, then: bytes = b"") -> bytes:
    """What the server answers to bytes that no client library would send."""
    address = urlsplit(server.url)
    with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
        connection.sendall(request)
        if then:
            connection.sendall(then)
        connection.shutdown(socket.SHUT_WR)
        answer = b""
        try:
            while block := connection.recv(65536):
                answer += block
        except ConnectionResetError:
            # Closed while we still had something to say.
            pass
    return answer


RAW = {
    "no http": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc",
    "two lengths": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
    b"Content-Length: 6\r\n\r\nhello",
    "length and chunks": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "negative length": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\n"
    b"Content-Length: -1\r\n\r\n",
    "bad chunk": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\n"
    b"Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n",
    "endless header": b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: " + b"y" * 200_000,
    "no host": b"GET /healthz HTTP/1.1\r\n\r\n",
    "two hosts": b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n",
    "NUL in the path": b"GET /api/v1/runs\x00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "web socket": b"GET /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
    b"Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    b"Sec-WebSocket-Version: 13\r\n\r\n",
}


@pytest.mark.parametrize("request_bytes", RAW.values(), ids=RAW.keys())
def test_broken_http_is_refused_and_the_server_lives(server: Server, request_bytes: bytes) -> None:
    """A 4xx or a closed connection, and health answers afterwards."""
    answer = raw(server, request_bytes)

    assert answer == b"" or answer.startswith(b"HTTP/1.1 4"), answer[:200]
    assert httpx.get(f"{server.url}/healthz").status_code == 200


@pytest.mark.usefixtures("nothing_left")
def test_upload_that_breaks_off_leaves_nothing(server: Server, alice: Caller) -> None:
    """The connection is cut in the middle of the announced body."""
    head = (
        f"POST {API}/runs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 500000\r\n"
        f"Authorization: {alice.http.headers['authorization']}\r\n"
        "Content-Type: multipart/form-data; boundary=b\r\n\r\n"
    ).encode()

    raw(server, head, then=form((FILE, RUN), end=b""))

    assert httpx.get(f"{server.url}/readyz").status_code == 200


def test_hostile_requests_left_no_trace_of_an_error_of_the_service(server: Server) -> None:
    """Whatever ran before this in the session: no answer was a 500."""
    lines = [json.loads(line) for line in list(server.log) if line.startswith("{")]

    assert [line for line in lines if line.get("status", 0) >= 500] == []
    for line in lines:
        # uvicorn refuses a broken chunk itself, and then logs that our answer comes too late.
        assert "LocalProtocolError" in line.get("exception", "LocalProtocolError")
