"""Access control: every route, with every kind of key that must not open it."""

from __future__ import annotations

import json
import re
import time
from html import unescape
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.access.service import AccessService
from app.database import Database
from app.http.gate import PUBLIC_PATHS, own_address
from tests.app.pretended import FAMILY
from tests.app.service import Caller, Server, make_key, run_text

OPEN = {
    f"{prefix}/{name}" for prefix in ("", "/api/v1") for name in ("healthz", "readyz", "metrics")
}


def test_only_health_and_login_are_open() -> None:
    """The contract requires a key for every call except health."""
    assert {"/login"} | OPEN == PUBLIC_PATHS


def test_unknown_path_requires_a_key(nobody: Caller) -> None:
    """A client without a key cannot find out which paths exist."""
    for path in ("/nothing", "/../../etc/passwd", "/runs/", "//runs", "/RUNS"):
        assert nobody.http.get(path).status_code == 401, path


@pytest.mark.parametrize("path", sorted(OPEN))
def test_health_answers_without_a_key(server: Server, path: str) -> None:
    """Health returns 200 under the API prefix and at the root."""
    assert httpx.get(server.url + path).status_code == 200


def test_revoked_key_opens_nothing(server: Server) -> None:
    """The first call after the revocation is rejected."""
    database = Database(f"sqlite:///{server.data_dir / 'motorid.sqlite3'}")
    access = AccessService(database)
    key, secret = access.create_key("to be revoked")
    with Caller(server, secret) as caller:
        before = caller.http.get("/runs").status_code
        access.revoke_key(key.id)
        after = caller.http.get("/runs").status_code
    database.close()

    assert (before, after) == (200, 401)


def test_event_stream_ends_when_its_key_is_revoked(server: Server) -> None:
    """The stream closes within seconds without an `end` event; the fit continues."""
    database = Database(f"sqlite:///{server.data_dir / 'motorid.sqlite3'}")
    access = AccessService(database)
    key, secret = access.create_key("to be revoked", "followed")
    other = make_key(server.data_dir, "followed")
    with Caller(server, secret) as lost, Caller(server, other) as kept:
        fit = lost.begin(lost.upload(run_text(40))["id"], seed=FAMILY)["id"]
        with lost.http.stream("GET", f"/fits/{fit}/events") as stream:
            lines = stream.iter_lines()
            next(line for line in lines if line.startswith("data"))
            access.revoke_key(key.id)
            began = time.monotonic()
            rest = list(lines)
            took = time.monotonic() - began
        kept.http.delete(f"/fits/{fit}")
    database.close()

    assert took < 10
    assert "event: end" not in rest


def test_items_of_another_workspace_are_not_found(alice: Caller, bob: Caller, stored: str) -> None:
    """Calls to its runs, fits and batches return 404, and lists do not contain them."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]
    batch = alice.http.post("/batches", json={"motors": [{"training": [stored]}]}).json()["id"]
    asked = [
        *(("GET", f"/runs/{stored}"), ("DELETE", f"/runs/{stored}")),
        *(("GET", f"/fits/{fit}{part}") for part in ("", "/events", "/report", "/posterior")),
        *(("DELETE", f"/fits/{fit}"), ("GET", f"/batches/{batch}")),
    ]

    for method, path in asked:
        assert bob.http.request(method, path).status_code == 404, (method, path)
    assert bob.http.post("/fits", json={"training": [stored]}).status_code == 404
    assert bob.http.post("/batches", json={"motors": [{"training": [stored]}]}).status_code == 404
    for path in ("/runs", "/fits", "/batches"):
        items = bob.http.get(path, params={"limit": 1000}).json()["items"]
        assert not {item["id"] for item in items} & {stored, fit, batch}
    assert alice.http.get(f"/runs/{stored}").status_code == 200
    assert alice.http.get(f"/fits/{fit}").status_code == 200


def test_foreign_item_and_missing_item_have_equal_responses(
    alice: Caller, bob: Caller, stored: str
) -> None:
    """The bodies differ only in the request id, so a client cannot probe for items."""
    theirs = bob.http.get(f"/runs/{stored}").json()
    nothing = bob.http.get("/runs/run_" + "a" * 26).json()

    assert theirs | {"request_id": ""} == nothing | {"request_id": ""}


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_request_from_another_site_changes_nothing(
    alice: Caller, stored: str, headers: dict[str, str]
) -> None:
    """Every changing method returns 403 even with a key; reading is permitted."""
    answers = [
        alice.http.post("/fits", json={"training": [stored]}, headers=headers),
        alice.http.post("/runs", files={"file": ("a.csv", run_text(1))}, headers=headers),
        alice.http.delete(f"/runs/{stored}", headers=headers),
    ]

    assert {answer.status_code for answer in answers} == {403}
    assert {answer.json()["code"] for answer in answers} == {"cross_site"}
    assert alice.http.get("/runs", headers=headers).status_code == 200


def test_no_other_site_may_read(alice: Caller) -> None:
    """No response, preflight included, has a CORS header."""
    headers = {"Origin": "http://evil.example", "Access-Control-Request-Method": "POST"}

    for answer in (alice.http.get("/runs", headers=headers), alice.http.options("/fits")):
        assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost.evil"])
def test_request_for_another_host_is_refused(server: Server, host: str) -> None:
    """On loopback the service accepts loopback names only, for health as well."""
    answer = httpx.get(f"{server.url}/healthz", headers={"Host": host})

    assert answer.status_code == 400


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8000", "127.0.0.1:1", "[::1]:8000"])
def test_request_for_a_loopback_name_is_answered(server: Server, host: str) -> None:
    """Any port is accepted, because a port may be forwarded."""
    assert httpx.get(f"{server.url}/healthz", headers={"Host": host}).status_code == 200


def test_every_response_carries_the_security_headers(alice: Caller, nobody: Caller) -> None:
    """This holds for success, errors, rejected requests and health."""
    answers = [
        alice.http.get("/runs"),
        alice.http.get("/nothing"),
        alice.http.post("/fits", json={}),
        nobody.http.get("/runs"),
        nobody.http.get("/healthz"),
    ]

    for answer in answers:
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe-eval" not in policy
        assert "unsafe-inline" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["x-request-id"]
        assert "server" not in answer.headers


def test_log_holds_requests_and_no_keys(server: Server, alice: Caller) -> None:
    """Each request is logged once as JSON, and no line contains the key."""
    secret = alice.http.headers["authorization"].removeprefix("Bearer ")
    alice.http.get("/runs", headers={"X-Request-ID": "request-of-this-test"})

    # The line is written after the response and read by a separate thread.
    deadline = time.monotonic() + 20.0
    ours: list[dict[str, Any]] = []
    while not ours and time.monotonic() < deadline:
        time.sleep(0.02)
        lines = [line for line in list(server.log) if line.startswith("{")]
        entries = [json.loads(line) for line in lines]
        ours = [entry for entry in entries if entry.get("request_id") == "request-of-this-test"]
    assert [(entry["method"], entry["path"], entry["status"]) for entry in ours] == [
        ("GET", "/api/v1/runs", 200)
    ]
    assert secret not in "".join(server.log)


def test_data_directory_is_closed_to_others(server: Server) -> None:
    """Only the owner can read uploads and results."""
    for part in ("runs", "fits", "incoming"):
        assert (server.data_dir / part).stat().st_mode & 0o077 == 0


def test_database_stores_hashes_of_keys(tmp_path: Path) -> None:
    """The file contains the workspace of a key but not its secret."""
    secret = make_key(tmp_path / "data", "some-workspace")
    stored = (tmp_path / "data" / "motorid.sqlite3").read_bytes()

    assert secret.encode() not in stored
    assert secret.removeprefix("motorid_").encode() not in stored
    assert b"some-workspace" in stored


def test_sign_in_leads_back_to_the_page_that_asked_for_the_key(server: Server) -> None:
    """A shared address survives the login, also a mistyped key."""
    address = "/motor?name=servo+%3C1%3E&x=%26"
    with httpx.Client(base_url=server.url, headers={"Accept": "text/html"}) as browser:
        login = browser.get(browser.get(address).headers["location"])
        [back] = re.findall(r'name="next" value="([^"]*)"', login.text)
        wrong = browser.post("/login", data={"key": "motorid_wrong", "next": unescape(back)})
        [again] = re.findall(r'name="next" value="([^"]*)"', wrong.text)
        key = make_key(server.data_dir, "back")
        right = browser.post("/login", data={"key": key, "next": unescape(again)})

    assert unescape(back) == address
    assert again == back
    assert (right.status_code, right.headers["location"]) == (303, address)


def test_part_of_a_page_leads_to_the_login_and_back(server: Server) -> None:
    """The script sends the address of the page; only its path and query are used."""
    page = {
        "HX-Request": "true",
        "HX-Current-URL": "https://elsewhere.example/fits/fit_x/loop?kp=2",
    }

    answer = httpx.get(f"{server.url}/fits/fit_x/loop", headers=page)

    assert answer.headers["HX-Redirect"] == "/login?ended&next=/fits/fit_x/loop%3Fkp%3D2"


@pytest.mark.parametrize(
    "foreign",
    ["//elsewhere.example", "https://elsewhere.example", "/\\elsewhere.example", "", "/login?ended"]
    + ["/\t/elsewhere.example", "\\\\elsewhere.example", "javascript:alert(1)", "/" + 3000 * "x"],
)
def test_sign_in_never_leads_to_another_site(server: Server, foreign: str) -> None:
    """Such an address, which a link to the login page could name, is replaced or refused."""
    key = make_key(server.data_dir, "back")

    answer = httpx.post(f"{server.url}/login", data={"key": key, "next": foreign})

    assert (answer.status_code, answer.headers.get("location")) in ((303, "/"), (422, None))
    assert own_address(foreign) == "/"
