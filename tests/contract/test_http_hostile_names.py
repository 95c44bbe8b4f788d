"""File names and URL paths that try to escape from the data directory."""

from __future__ import annotations

import pytest

from tests.app.names import NAMES
from tests.app.service import Caller, Server, run_text
from tests.contract.hostile import UNKNOWN, assert_is_problem, form


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:30])
def test_name_of_a_file_is_a_label_and_never_a_path(
    alice: Caller, server: Server, name: str
) -> None:
    """The bytes are stored under the run ID; the label has no directory."""
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
def test_unknown_item_is_not_found(alice: Caller, path: str) -> None:
    """GET and DELETE return 404 as a problem."""
    assert_is_problem(alice.http.get(path), 404)
    assert_is_problem(alice.http.delete(path), 404, 405)
