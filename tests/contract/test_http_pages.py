"""Web pages: login, escaped content, and no external resources."""

from __future__ import annotations

import re
import secrets
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.app.service import Caller, Server, make_key, run_text, serving

HTML = {"Accept": "text/html"}


@pytest.fixture
def browser(server: Server) -> Iterator[httpx.Client]:
    """HTTP client with cookies and without a key."""
    with httpx.Client(base_url=server.url, headers=HTML) as client:
        yield client


@pytest.fixture
def key(server: Server) -> str:
    """Key of a workspace for the page tests."""
    return make_key(server.data_dir, "pages")


def test_login_opens_a_session_and_logout_ends_it(browser: httpx.Client, key: str) -> None:
    """Without a session the start page redirects to the login page."""
    sent_away = browser.get("/")
    wrong = browser.post("/login", data={"key": "motorid_wrong"})
    right = browser.post("/login", data={"key": f" {key} "})
    inside = browser.get("/")
    called = browser.get("/api/v1/runs")
    out = browser.post("/logout")
    after = browser.get("/")

    assert (sent_away.status_code, sent_away.headers["location"]) == (303, "/login")
    assert wrong.status_code == 401
    assert "The key is not valid" in wrong.text
    assert (right.status_code, right.headers["location"]) == (303, "/")
    cookie = right.headers["set-cookie"].lower()
    assert {"httponly", "samesite=strict"} <= {part.strip() for part in cookie.split(";")}
    assert key not in cookie
    assert inside.status_code == 200
    assert "Workspace pages" in inside.text
    assert called.status_code == 200
    assert out.status_code == 303
    assert after.status_code == 303


def test_keys_page_shows_that_its_own_key_is_in_use(browser: httpx.Client, server: Server) -> None:
    """A key that seems unused would be revoked."""
    workspace = f"keys-{secrets.token_hex(4)}"
    browser.post("/login", data={"key": make_key(server.data_dir, workspace)})

    shown = browser.get("/keys").text

    # Created and last used; the key does not expire.
    assert shown.partition("<tbody")[2].count("<time") == 2


def test_older_fits_are_on_further_pages(browser: httpx.Client, server: Server) -> None:
    """After the cursor of the newest fit, the page has the other one and leads back."""
    key = make_key(server.data_dir, f"fits-{secrets.token_hex(4)}")
    with Caller(server, key) as caller:
        run = str(caller.upload(run_text(40))["id"])
        older, newest = (caller.begin(run, seed=0)["id"] for _ in range(2))
        cursor = caller.http.get("/fits", params={"limit": 1}).json()["next"]
    browser.post("/login", data={"key": key})

    first, second = browser.get("/").text, browser.get("/", params={"after": cursor}).text

    assert [f'data-fit="{fit}"' in first for fit in (older, newest)] == [True, True]
    assert [f'data-fit="{fit}"' in second for fit in (older, newest)] == [True, False]
    assert "Newest fits" not in first
    assert "Newest fits" in second


def test_secure_cookies_follow_the_setting(browser: httpx.Client, key: str, data_dir: Path) -> None:
    """Behind a proxy that terminates TLS, only the setting can request the Secure attribute."""
    plain = browser.post("/login", data={"key": key}).headers["set-cookie"]
    secret = make_key(data_dir)
    with serving(data_dir, SECURE_COOKIES="true") as server:
        secure = httpx.post(f"{server.url}/login", data={"key": secret}).headers["set-cookie"]

    assert "Secure" not in plain
    assert "; Secure" in secure


def test_cookie_is_rejected_for_another_site(browser: httpx.Client, key: str) -> None:
    """A form on another site may carry the cookie, but its Origin is foreign."""
    browser.post("/login", data={"key": key})

    answer = browser.post(
        "/api/v1/fits", json={"training": ["x"]}, headers={"Origin": "http://evil.example"}
    )

    assert answer.status_code == 403


def test_login_from_another_site_is_refused(browser: httpx.Client, key: str) -> None:
    """Otherwise a site could log a user in to a workspace of its own."""
    answer = browser.post("/login", data={"key": key}, headers={"Sec-Fetch-Site": "cross-site"})

    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


def test_own_page_may_withhold_its_origin(browser: httpx.Client, key: str) -> None:
    """Chromium sends `Origin: null` from a page with a strict referrer policy."""
    headers = {"Sec-Fetch-Site": "same-origin", "Origin": "null"}

    assert browser.post("/login", data={"key": key}, headers=headers).status_code == 303


def test_session_is_invalid_after_logout(browser: httpx.Client, key: str) -> None:
    """The old cookie gives 401."""
    cookie = browser.post("/login", data={"key": key}).cookies["motorid_session"]
    browser.post("/logout")

    answer = browser.get("/api/v1/runs", headers={"Cookie": f"motorid_session={cookie}"})

    assert answer.status_code == 401


def test_client_supplied_names_are_escaped(alice: Caller, server: Server) -> None:
    """Markup in the names of a motor and a file is escaped on both pages."""
    evil = '"><script>alert(1)</script>'
    run = alice.upload(run_text(50), evil, motor=evil)
    answer = alice.http.post("/fits", json={"training": [run["id"]], "motor": evil})
    fit = alice.wait(answer.json()["id"])

    for path in ("/", f"/fits/{fit['id']}"):
        page = httpx.get(server.url + path, headers=alice.http.headers)
        assert page.status_code == 200
        assert "<script>alert" not in page.text
        assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page.text


def test_fit_page_of_another_workspace_is_not_found(
    alice: Caller, bob: Caller, server: Server, stored: str
) -> None:
    """The page returns 404, as the API does."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]

    assert httpx.get(f"{server.url}/fits/{fit}", headers=bob.http.headers).status_code == 404


def test_keys_of_a_workspace_are_created_and_revoked(browser: httpx.Client, server: Server) -> None:
    """The secret is shown once, works at once, and no longer after it was revoked."""
    workspace = f"keys-{secrets.token_hex(6)}"
    browser.post("/login", data={"key": make_key(server.data_dir, workspace)})

    made = browser.post("/keys", data={"name": "bench 4", "days": "30"})
    [secret] = re.findall(r'class="secret">(motorid_[\w-]+)<', made.text)
    bearer = {"Authorization": f"Bearer {secret}"}
    works = httpx.get(f"{server.url}/api/v1/runs", headers=bearer)
    later = browser.get("/keys").text
    [key] = re.findall(r'hx-post="/keys/(\w+)/revoke"[^>]*Revoke bench 4', later.replace("\n", " "))
    revoked = browser.post(f"/keys/{key}/revoke")
    refused = httpx.get(f"{server.url}/api/v1/runs", headers=bearer)

    assert works.status_code == 200
    assert secret not in later
    assert (revoked.status_code, refused.status_code) == (200, 401)
    assert ">revoked</span>" in revoked.text


def test_an_action_after_a_key_was_revoked_leads_to_the_reason(
    browser: httpx.Client, server: Server
) -> None:
    """The page that led to the login was signed in; who only opens the service gets no reason."""
    part = {"HX-Request": "true"}

    refused = browser.post("/fits", headers=part)
    login = browser.get(refused.headers["HX-Redirect"]).text

    assert refused.status_code == 401
    assert "key was revoked" in login
    assert "key was revoked" not in browser.get("/login").text


def test_only_an_owner_manages_keys(browser: httpx.Client, server: Server) -> None:
    """A key made without the box of an owner opens the data, and neither page nor calls of keys."""
    workspace = f"keys-{secrets.token_hex(6)}"
    with httpx.Client(base_url=server.url, headers=HTML) as owner:
        owner.post("/login", data={"key": make_key(server.data_dir, workspace)})
        made = owner.post("/keys", data={"name": "bench 4"})
        also = owner.post("/keys", data={"name": "second owner", "owner": "true"})
        keys = re.findall(r"keys/(key_\w+)/revoke", owner.get("/keys").text)
    secret, second = (
        re.findall(r'class="secret">(motorid_[\w-]+)<', page.text)[0] for page in (made, also)
    )
    browser.post("/login", data={"key": secret})

    answers = [
        browser.get("/keys"),
        browser.post("/keys", data={"name": "mine"}),
        *(browser.post(f"/keys/{key}/revoke") for key in keys),
    ]

    assert len(keys) == 3
    assert {answer.status_code for answer in answers} == {403}
    assert "ask an owner" in answers[0].text
    assert "/keys" not in browser.get("/").text
    assert browser.get("/api/v1/runs").status_code == 200
    assert httpx.get(f"{server.url}/keys", headers={"Authorization": f"Bearer {second}"}).is_success


@pytest.mark.parametrize(
    ("name", "days", "words"),
    [("bench 4", "soon", "is not a number"), ("bench 4", "-1", "expected more than 0")],
)
def test_fault_of_a_new_key_is_said_beside_its_form(
    browser: httpx.Client, key: str, name: str, days: str, words: str
) -> None:
    """The sentence has a place of its own, so that the form remains."""
    browser.post("/login", data={"key": key})

    answer = browser.post("/keys", data={"name": name, "days": days})

    assert answer.status_code == 422
    assert words in re.findall('id="keys-problem">(.*?)</div>', answer.text)[0]
    assert answer.headers["HX-Retarget"] == "#keys-problem"


def test_keys_of_other_workspaces_are_not_shown(
    browser: httpx.Client, key: str, server: Server
) -> None:
    """A name that only another workspace uses does not occur."""
    with httpx.Client(base_url=server.url, headers=HTML) as other:
        other.post("/login", data={"key": make_key(server.data_dir, "pages-2")})
        other.post("/keys", data={"name": "secret bench"})
    browser.post("/login", data={"key": key})

    assert "secret bench" not in browser.get("/keys").text


def test_report_and_fleet_page_have_a_way_back(alice: Caller, server: Server, stored: str) -> None:
    """The report is framed: its sandbox sends no cookie with a link. No other site can frame it."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]
    batch = alice.http.post("/batches", json={"motors": [{"training": [stored]}]}).json()["id"]

    framed = httpx.get(f"{server.url}/fits/{fit}/report", headers=of_key(alice))
    report = alice.http.get(f"/fits/{fit}/report")
    fleet = alice.http.get(f"/batches/{batch}/report")

    assert f'href="/fits/{fit}"' in framed.text
    assert f'<iframe src="/api/v1/fits/{fit}/report"' in framed.text
    assert "frame-src 'self'" in framed.headers["content-security-policy"]
    assert "frame-ancestors 'none'" in framed.headers["content-security-policy"]
    assert "frame-ancestors 'self'" in report.headers["content-security-policy"]
    assert report.headers["x-frame-options"] == "SAMEORIGIN"
    assert 'href="/"' in fleet.text


def of_key(caller: Caller) -> dict[str, str]:
    """Header with the key of a client, without the Accept header of its script."""
    return {"Authorization": caller.http.headers["authorization"]}


@pytest.mark.parametrize(
    ("path", "status"),
    [("/nowhere", 404), ("/fits/fit_x", 404), ("/api/v1/fits/fit_x/report", 404)],
)
def test_browser_gets_a_page_for_an_unknown_address(
    alice: Caller, server: Server, path: str, status: int
) -> None:
    """Status and sentence are those of the problem; a link leads back to the start page."""
    page = httpx.get(server.url + path, headers={**of_key(alice), **HTML})
    problem = httpx.get(server.url + path, headers=alice.http.headers)

    assert (page.status_code, problem.status_code) == (status, status)
    assert page.headers["content-type"].startswith("text/html")
    assert problem.json()["detail"][1:] in page.text
    assert 'href="/"' in page.text


def test_call_of_the_interface_never_gets_a_page(alice: Caller, server: Server) -> None:
    """A script may copy the Accept header of a browser."""
    answer = alice.http.get("/fits/fit_x", headers=HTML)

    assert answer.headers["content-type"] == "application/problem+json"


def test_part_of_a_page_gets_the_sentence_of_a_problem(alice: Caller, server: Server) -> None:
    """A script shows the response inside of the page; without a session it opens the login page."""
    part = {"HX-Request": "true"}
    refused = httpx.get(f"{server.url}/nowhere", headers={**of_key(alice), **part})
    unknown = httpx.get(f"{server.url}/nowhere", headers=part)

    assert refused.status_code == 404
    assert refused.text.startswith("<p ")
    assert "<html" not in refused.text
    assert unknown.headers["HX-Redirect"] == "/login?ended"


def test_report_of_a_signed_out_reader_asks_for_the_key(server: Server) -> None:
    """The address of a report is opened by people, although it belongs to the interface."""
    answer = httpx.get(f"{server.url}/api/v1/fits/fit_x/report", headers=HTML)

    assert answer.status_code == 303
    assert answer.headers["location"] == "/login?next=/api/v1/fits/fit_x/report"
