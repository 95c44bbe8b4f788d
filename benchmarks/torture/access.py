"""Access control: all routes with invalid keys, and path traversal in file names."""

from __future__ import annotations

from pathlib import Path

import httpx

from app.main import create_app
from app.settings import load_settings
from benchmarks.torture.outcome import Outcome
from tests.app.names import NAMES
from tests.app.routes import PLACE, every_route, expired_key, filled, revoked_key
from tests.app.service import Caller, Server, make_key, run_text, serving

__all__ = ["run"]


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Run all tests; there is no short version."""
    data_dir = directory / "data"
    alice_key, bob_key = (make_key(data_dir, name) for name in ("alice", "bob"))
    with (
        serving(data_dir, RATE_PER_S=0) as server,
        Caller(server, alice_key) as alice,
        Caller(server, bob_key) as bob,
    ):
        return [_matrix(server, alice, bob, directory), _names(server, alice)]


def _matrix(server: Server, alice: Caller, bob: Caller, directory: Path) -> Outcome:
    routes = every_route(create_app(load_settings(data_dir=directory / "routes")))
    run_id = str(alice.upload(run_text(0))["id"])
    fit = str(alice.wait(alice.begin(run_id)["id"])["id"])
    batch = alice.http.post("/batches", json={"motors": [{"training": [run_id]}]}).json()["id"]
    ids = {"run_id": run_id, "fit_id": fit, "batch_id": str(batch)}
    keys = {
        "no key": None,
        "a wrong key": "motorid_" + "x" * 43,
        "a revoked key": revoked_key(server.data_dir),
        "an expired key": expired_key(server.data_dir),
    }
    wrong: list[str] = []
    tried = 0
    for kind, key in keys.items():
        headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        with httpx.Client(base_url=server.url, headers=headers) as client:
            for method, path in routes:
                status = client.request(method, filled(path, ids)).status_code
                tried += 1
                if status != 401:
                    wrong.append(f"{method} {path} with {kind}: {status}")
    for method, path in routes:
        if path == "/logout":
            continue
        answer = bob.http.request(method, server.url + filled(path, ids))
        tried += 1
        # Routes without an id return the data of the caller's own workspace.
        is_shut = answer.status_code == 404 if PLACE.search(path) else True
        if not is_shut or any(thing in answer.text for thing in ids.values()):
            wrong.append(f"{method} {path} with another workspace's key: {answer.status_code}")
    kept = alice.http.get(f"/runs/{run_id}").status_code, alice.http.get(f"/fits/{fit}").status_code
    if kept != (200, 200):
        wrong.append(f"what alice has: {kept}")
    return Outcome(
        f"{len(routes)} routes x no, wrong, revoked, expired and another workspace's key",
        "401, 404, or no data of the other workspace",
        "; ".join(wrong) or f"{tried} calls, no data disclosed",
        not wrong,
    )


def _names(server: Server, alice: Caller) -> Outcome:
    before = _files(server)
    wrong: list[str] = []
    stored: set[str] = set()
    for number, name in enumerate(NAMES):
        shown = name.replace("\r", "%0D").replace("\n", "%0A")
        head = f'--b\r\nContent-Disposition: form-data; name="file"; filename="{shown}"\r\n\r\n'
        body = head.encode("utf-8", "surrogateescape") + run_text(100 + number) + b"\r\n--b--\r\n"
        answer = alice.http.post(
            "/runs", content=body, headers={"Content-Type": "multipart/form-data; boundary=b"}
        )
        if answer.status_code == 201:
            stored.add(answer.json()["id"])
            label = answer.json()["file"]
            if set(label) & set("/\\\0\r\n") or not label.isprintable():
                wrong.append(f"{name[:40]!r} is shown as {label!r}")
        elif answer.status_code not in (400, 422):
            wrong.append(f"{name[:40]!r}: {answer.status_code}")
    new = {path for path in _files(server) - before if "journal" not in path.name}
    if new != {server.data_dir / "runs" / run_id for run_id in stored}:
        wrong.append(f"files that have no place: {sorted(map(str, new))[:5]}")
    return Outcome(
        f"{len(NAMES)} file names with path components",
        "stored under names of the server, none outside the data directory",
        "; ".join(wrong) or f"{len(stored)} stored under ids, {len(NAMES) - len(stored)} refused",
        not wrong,
    )


def _files(server: Server) -> set[Path]:
    """All files around the data directory."""
    return {path for path in server.data_dir.parent.rglob("*") if path.is_file()}
