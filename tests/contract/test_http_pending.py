"""Pending runs: files that are shown, corrected by selection and confirmed on the start page."""

from __future__ import annotations

import json
import re
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from tests.app.pending import Page, scope_text, selected
from tests.app.service import Caller, Server, make_key, run_text, serving
from tests.ingest.scopes import SIDES, beside


def test_menus_offer_the_samples_of_a_file_and_no_settings_beside_them(
    page: Page, tmp_path: Path
) -> None:
    """A file of Tektronix TDS for one channel: its time is found, and CH1 is in the menus."""
    file = beside(tmp_path / "F0000CH1.CSV", 1, next(iter(SIDES.values())), ",")

    page.drop(file.read_bytes(), file.name)

    shown = page.shown()
    assert re.search(r"<option[^>]*>CH1</option>", shown)
    assert "motorid join" in shown
    assert "column 2" not in shown
    assert "Record Length" not in shown


def test_dropped_file_is_shown_and_becomes_a_run_when_confirmed(page: Page) -> None:
    """Columns, units and plotted samples are those of the file; a reload shows the same."""
    run = page.drop(run_text(1), motor="servo 1")
    samples = page.http.get(f"/pending/{run}/samples").json()
    before, shown = page.runs(), page.shown()
    answer = page.http.post("/pending/confirm")

    assert before == []
    assert run in shown
    assert 'value="servo 1"' in shown
    assert len(samples["current_A"]) == len(samples["time_s"]) == 60
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    (stored,) = page.runs()
    assert (stored["id"], stored["motor"], stored["mapping"]) == (run, "servo 1", None)
    assert f'id="{run}"' not in page.shown()


def test_runs_added_twice_at_once_keep_their_files(page: Page) -> None:
    """Two tabs add the same files while a third names the motor: all runs can be read after it."""
    for seed in range(4):
        page.drop(run_text(seed))
    paths = ["/pending/confirm", "/pending/labels", "/pending/confirm", "/pending/confirm"]
    with ThreadPoolExecutor(len(paths)) as pool:
        answers = list(pool.map(lambda path: page.http.post(path, data={"motor": "m 1"}), paths))

    assert [answer.status_code for answer in answers] == [303, 200, 303, 303]
    stored = [run["id"] for run in page.runs()]
    assert len(stored) == 4
    assert {page.http.post(f"/pending/{run}/reopen").status_code for run in stored} == {200}


def test_run_added_before_its_correction_is_examined_is_added_as_corrected(
    page: Page, server: Server
) -> None:
    """The state between the two steps of a correction: the new mapping, the old ranges."""
    run = page.drop(run_text(27))
    before = page.http.get(f"/pending/{run}/samples").json()
    mapping = {"voltage_V": {"column": "voltage_V", "scale": 2.0}}
    with sqlite3.connect(server.data_dir / "motorid.sqlite3", timeout=30) as database:
        database.execute(
            "UPDATE pending_runs SET mapping = ? WHERE id = ?", (json.dumps(mapping), run)
        )

    page.http.post("/pending/confirm")

    (added,) = page.http.get("/api/v1/runs").json()["items"]
    assert added["mapping"] == mapping
    assert added["channels"]["voltage_V"]["max"] == pytest.approx(
        2.0 * max(before["voltage_V"]), rel=1e-4
    )


def test_file_that_is_a_run_already_is_not_added_again(page: Page) -> None:
    """The same bytes with the same mapping are the same run."""
    page.drop(run_text(11))
    page.http.post("/pending/confirm")
    page.drop(run_text(11), "copy.csv")
    page.http.post("/pending/confirm")

    assert len(page.runs()) == 1
    assert "copy.csv" not in page.shown()


def test_a_file_that_is_a_run_already_is_said_and_not_counted(page: Page) -> None:
    """Of four files one is stored, and one is dropped twice: two are new."""
    page.drop(run_text(20))
    page.http.post("/pending/confirm")
    for seed in (20, 21, 22, 22):
        page.drop(run_text(seed))
    shown = page.shown()
    page.http.post("/pending/confirm")

    assert shown.count(">already added</span>") == 2
    assert ">Add 2 runs</button>" in shown
    assert len(page.runs()) == 3


@pytest.mark.parametrize(
    ("content", "state", "words"),
    [
        (run_text(28), "already added", "already among the runs or above"),
        (b"", "cannot be read", "already above; discard one of the two"),
    ],
)
def test_a_file_that_is_dropped_twice_is_said_at_once(
    page: Page, content: bytes, state: str, words: str
) -> None:
    """The answer to the second upload says it, as the list does, whether the file can be read."""
    files = {"file": ("run.csv", content)}
    first, second = (page.http.post("/pending", files=files).text for _ in range(2))

    assert words not in first
    assert f">{state}</span>" in second
    assert words in second
    assert page.shown().count(words) == 1


def test_a_stored_run_that_is_reopened_is_new_once_its_mapping_changes(page: Page) -> None:
    """Its file with its mapping is a run; the same file in other units is another run."""
    page.drop(scope_text(23), "scope.csv")
    run = re.findall(r'<article class="pending" id="(\w+)"', page.shown())[0]
    page.http.post(f"/pending/{run}/mapping", data=selected())
    page.http.post("/pending/confirm")
    page.http.post(f"/pending/{run}/reopen")
    (copy,) = re.findall(r'<article class="pending" id="(\w+)"', before := page.shown())
    after = page.http.post(
        f"/pending/{copy}/mapping", data=selected(**{"current_A__factor": "2"})
    ).text

    assert ">already added</span>" in before
    assert ">Add 0 runs</button>" in before
    assert ">ready</span>" in after
    assert ">Add 1 run</button>" in after


def test_corrected_run_takes_the_role_of_the_earlier_one(page: Page) -> None:
    """The earlier run of the file stays stored without a role, so a fit has the file once."""
    page.drop(scope_text(27), "scope.csv")
    (wrong,) = re.findall(r'<article class="pending" id="(\w+)"', page.shown())
    page.http.post(f"/pending/{wrong}/mapping", data=selected())
    page.http.post("/pending/confirm")
    page.http.post("/choice", data={f"role.{wrong}": "validation"})
    page.http.post(f"/pending/{wrong}/reopen")
    (right,) = re.findall(r'<article class="pending" id="(\w+)"', page.shown())
    page.http.post(f"/pending/{right}/mapping", data=selected(**{"current_A__factor": "2"}))
    page.http.post("/pending/confirm")

    menus = re.findall(r'name="role\.(\w+)"(.*?)</select>', page.shown(), re.DOTALL)
    roles = [(run, role) for run, menu in menus for role in re.findall(r" selected>(\w+)", menu)]

    assert roles == [(right, "validation")]


def test_all_files_are_discarded_at_once(page: Page, server: Server) -> None:
    """The stored runs remain."""
    page.drop(run_text(24))
    page.http.post("/pending/confirm")
    dropped = [page.drop(run_text(seed)) for seed in (25, 26)]

    shown = page.http.delete("/pending").text

    assert "<article" not in shown
    assert not any((server.data_dir / "runs" / run).exists() for run in dropped)
    assert len(page.runs()) == 1


def test_discarded_file_leaves_nothing(page: Page, server: Server) -> None:
    """The file is deleted with its row."""
    run = page.drop(run_text(12))
    assert (server.data_dir / "runs" / run).is_file()

    page.http.delete(f"/pending/{run}")

    assert not (server.data_dir / "runs" / run).exists()
    assert page.http.get(f"/pending/{run}/samples").status_code == 404


def test_pending_run_of_another_workspace_is_not_found(page: Page, bob: Caller) -> None:
    """Bob gets 404 from every call on a pending run that is not his."""
    run = page.drop(run_text(13))
    url = str(page.http.base_url).rstrip("/") + f"/pending/{run}"
    headers = {"Authorization": bob.http.headers["authorization"]}

    answers = [
        httpx.get(f"{url}/samples", headers=headers),
        httpx.post(f"{url}/mapping", headers=headers),
        httpx.delete(url, headers=headers),
    ]

    assert [answer.status_code for answer in answers] == [404, 404, 404]
    assert run in page.shown()


def test_pending_runs_survive_a_restart_and_count_for_the_quota(data_dir: Path) -> None:
    """A quota of one run permits one pending run; a second one is refused with the reason."""
    make_key(data_dir)
    with serving(data_dir, QUOTA_RUNS=1) as server, Page(server, "quota") as page:
        run = page.drop(run_text(14))
    with serving(data_dir, QUOTA_RUNS=1) as server, Page(server, "quota") as page:
        refused = page.http.post("/pending", files={"file": ("b.csv", run_text(15))})
        shown = page.shown()

    assert refused.status_code == 403
    assert "1 runs of 1 allowed" in refused.text
    assert run in shown
