"""Every route with every invalid key, and every item with a key of another workspace."""

from __future__ import annotations

import json
import re

import httpx
import pytest

from app.main import create_app
from app.settings import load_settings
from tests.app.routes import PLACE, every_route, expired_key, filled, revoked_key
from tests.app.service import Caller, Server


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str]]:
    """Method and path template of every call that requires a key."""
    settings = load_settings(data_dir=tmp_path_factory.mktemp("routes"))
    found = every_route(create_app(settings))
    # Guard against an incomplete list: calls, pages and the OpenAPI document.
    assert {("GET", "/"), ("GET", "/fits/{fit_id}"), ("POST", "/logout"), ("GET", "/docs")} <= {
        *found
    }
    assert len(found) >= 20
    return found


@pytest.fixture(scope="module")
def ids(alice: Caller, server: Server, stored: str) -> dict[str, str]:
    """ID of an item of alice for each path parameter."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]
    batch = alice.http.post("/batches", json={"motors": [{"training": [stored]}]}).json()["id"]
    page = httpx.get(f"{server.url}/keys", headers=alice.http.headers).text
    [key] = re.findall(r'hx-post="/keys/(key_\w+)/revoke"', page)[:1]
    return {"run_id": stored, "fit_id": fit, "batch_id": batch, "key_id": key}


@pytest.mark.parametrize("kind", ["none", "wrong", "revoked", "expired"])
def test_no_route_accepts_an_invalid_key(
    server: Server, closed: list[tuple[str, str]], ids: dict[str, str], kind: str
) -> None:
    """Each route returns 401 with a challenge, even if the item exists."""
    keys = {"wrong": "motorid_" + "x" * 43}
    if kind == "revoked":
        keys[kind] = revoked_key(server.data_dir)
    if kind == "expired":
        keys[kind] = expired_key(server.data_dir)
    headers = {"Authorization": f"Bearer {keys[kind]}"} if kind in keys else {}
    with httpx.Client(base_url=server.url, headers=headers) as client:
        for method, path in closed:
            answer = client.request(method, filled(path, ids))

            assert answer.status_code == 401, (method, path)
            assert answer.headers["www-authenticate"].startswith("Bearer")
            if method != "HEAD":
                assert answer.json()["code"] == "unauthorized"


@pytest.mark.parametrize(
    "authorization",
    [
        "Bearer",
        "Bearer " + "x" * 5000,
        "Basic YWxpY2U6c2VjcmV0",
        "Bearer ' OR 1=1 --",
        b"Bearer \xff\xfe",
    ],
)
def test_no_route_accepts_a_malformed_authorization(
    server: Server, closed: list[tuple[str, str]], authorization: str | bytes
) -> None:
    """Each route returns 401, whatever the Authorization header contains."""
    with httpx.Client(base_url=server.url, headers={"Authorization": authorization}) as client:  # type: ignore[arg-type]
        for method, path in closed:
            answer = client.request(method, PLACE.sub("run_" + "a" * 26, path))

            assert answer.status_code == 401, (method, path)


def test_every_item_is_404_for_another_workspace(
    bob: Caller, server: Server, closed: list[tuple[str, str]], ids: dict[str, str]
) -> None:
    """Each method on an item of alice returns 404 to a valid key of bob."""
    about_things = [(method, path) for method, path in closed if PLACE.search(path)]
    assert len(about_things) >= 8
    for method, path in about_things:
        bodies = {
            "feedback": {"controllers": ["P:1"]},
            "tunings": {"specification": {"overshoot": 10}},
        }
        body = bodies.get(path.rpartition("/")[2])
        answer = bob.http.request(method, server.url + filled(path, ids), json=body)

        assert answer.status_code == 404, (method, path)


def test_no_list_contains_items_of_another_workspace(
    bob: Caller, server: Server, closed: list[tuple[str, str]], ids: dict[str, str]
) -> None:
    """No list or page for bob contains an ID of alice."""
    for method, path in closed:
        if PLACE.search(path) or path == "/logout":
            continue
        answer = bob.http.request(method, server.url + path)

        assert not [thing for thing in ids.values() if thing in answer.text], (method, path)


def test_items_of_alice_still_exist(alice: Caller, ids: dict[str, str]) -> None:
    """None of the calls above has removed an item."""
    for path in ("/runs/{run_id}", "/fits/{fit_id}", "/batches/{batch_id}"):
        assert alice.http.get(filled(path, ids)).status_code == 200


def test_no_line_of_the_log_contains_a_key(server: Server, alice: Caller) -> None:
    """The key is sent in each place where a client may put it by mistake."""
    secret = alice.http.headers["authorization"].removeprefix("Bearer ")
    marker = "after-the-keys-were-sent"
    alice.http.get(f"/runs/{secret}")
    alice.http.get("/runs", params={"after": secret, "motor": secret})
    alice.http.get("/runs", headers={"X-Request-ID": secret, "Cookie": f"motorid_session={secret}"})
    alice.http.post("/runs", files={"file": (secret, b"x")}, data={"motor": secret})
    alice.http.post("/fits", json={"training": [secret], "motor": secret})
    alice.http.post("/fits", json={secret: secret}, headers={"Idempotency-Key": secret})
    page = httpx.post(f"{server.url}/login", data={"key": secret}, follow_redirects=False)
    assert page.status_code == 303
    token = page.cookies["motorid_session"]
    httpx.get(f"{server.url}/fits/{token}", headers={"Cookie": f"motorid_session={token}"})
    httpx.get(f"{server.url}/{secret}", headers={"X-Request-ID": marker})

    for _ in range(1000):
        if any(marker in line for line in list(server.log)):
            break
        alice.http.get("/healthz")
    text = "".join(server.log)

    assert marker in text
    assert secret not in text
    assert token not in text
    assert secret.removeprefix("motorid_") not in text
    for line in text.splitlines()[1:]:
        json.loads(line)
