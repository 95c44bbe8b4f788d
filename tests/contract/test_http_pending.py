"""Pending runs: files that are shown, corrected by selection and confirmed on the start page."""

from __future__ import annotations

import json
import re
import secrets
import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from tests.app.service import Caller, Server, make_key, run_text, serving
from tests.ingest.scopes import SIDES, beside

PART = {"HX-Request": "true"}
COLUMNS = {
    "time_s": ("t", "s"),
    "voltage_V": ("CH1", "V"),
    "current_A": ("CH2", "A"),
    "speed_rad_s": ("n", "rpm"),
}


def scope_text(seed: int) -> bytes:
    """Run of an oscilloscope, whose header names neither channels nor units."""
    header, *rows = run_text(seed).decode().splitlines()
    return "\n".join(["t,CH1,CH2,n,T", *rows, ""]).encode()


def selected(**changed: str) -> dict[str, str]:
    """Form in which the user has selected a column and a unit for each channel."""
    form: dict[str, str] = {}
    for channel, (column, unit) in COLUMNS.items():
        form |= {f"{channel}.column": column, f"{channel}.was": column, f"{channel}.unit": unit}
    return form | {name.replace("__", "."): text for name, text in changed.items()}


class Page:
    """Start page of one workspace."""

    def __init__(self, server: Server, workspace: str) -> None:
        headers = {"Authorization": f"Bearer {make_key(server.data_dir, workspace)}", **PART}
        self.http = httpx.Client(base_url=server.url, headers=headers, timeout=60)

    def __enter__(self) -> Page:
        """Return the page."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connections."""
        self.http.close()

    def drop(self, content: bytes, name: str = "run.csv", **labels: str) -> str:
        """Drop a file; return the ID of the pending run."""
        answer = self.http.post("/pending", files={"file": (name, content)}, data=labels)
        assert answer.status_code == 200, answer.text
        return str(answer.text.partition('id="')[2].partition('"')[0])

    def shown(self) -> str:
        """Text of the start page."""
        return self.http.get("/").text

    def runs(self) -> list[dict[str, object]]:
        """Runs of the workspace, newest first."""
        return list(self.http.get("/api/v1/runs").json()["items"])


@pytest.fixture
def page(server: Server) -> Iterator[Page]:
    """Start page of a workspace without runs."""
    with Page(server, f"pending-{secrets.token_hex(8)}") as opened:
        yield opened


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


def test_column_with_the_name_of_a_channel_is_suggested(page: Page) -> None:
    """`T` may be a time too, but `time_s` is one."""
    run = page.drop(scope_text(3).replace(b"t,CH1", b"time_s,CH1"), "scope.csv")
    menu = page.shown().partition(f'id="{run}"')[2].partition("Column of time")[2]
    assert re.search(r"<option[^>]* selected[^>]*>time_s<", menu.partition("</select>")[0])


def test_unreadable_file_is_corrected_by_selection(page: Page) -> None:
    """12 V are entered as CH1 in V; a speed of 1 rpm is 0.1047 rad/s."""
    run = page.drop(scope_text(2), "scope.csv")
    first = page.shown()
    page.http.post("/pending/confirm")
    unread = page.runs()
    corrected = page.http.post(f"/pending/{run}/mapping", data=selected())
    page.http.post("/pending/confirm")

    assert "needs a correction" in first
    assert "{" not in first.partition(run)[2].partition("</article>")[0]
    assert unread == []
    assert ">ready</span>" in corrected.text
    (stored,) = page.runs()
    assert stored["mapping"] == {
        channel: {"column": column, "unit": unit} for channel, (column, unit) in COLUMNS.items()
    }


def test_wrong_selection_erases_no_other(page: Page) -> None:
    """The column of the current is selected for the voltage, too; all fields keep their values."""
    run = page.drop(scope_text(3))
    wrong = selected(voltage_V__column="CH2", voltage_V__was="CH2", current_A__factor="2.5")
    page.http.post(f"/pending/{run}/mapping", data=wrong)

    shown = page.shown()

    assert "both map to the column" in shown
    assert shown.count("<option selected>CH2</option>") == 2
    assert "<option selected>rpm</option>" in shown
    assert 'value="2.5"' in shown


def test_other_column_brings_its_own_unit(page: Page) -> None:
    """The unit that was selected for the column before does not apply to the new one."""
    header, *rows = run_text(4).decode().splitlines()
    run = page.drop("\n".join([header + ",n [rpm]", *(f"{row},100" for row in rows), ""]).encode())
    form = {
        "speed_rad_s.column": "n [rpm]", "speed_rad_s.was": "speed_rad_s",
        "speed_rad_s.unit": "rad/s",
    }  # fmt: skip

    answer = page.http.post(f"/pending/{run}/mapping", data=form)

    assert "10.5 … 10.5 rad/s" in answer.text


def test_mapping_of_a_bench_applies_to_its_next_file(page: Page) -> None:
    """The second file from the bench needs no correction; another form of file is not affected."""
    run = page.drop(scope_text(5), bench="bench 4")
    page.http.post(f"/pending/{run}/mapping", data=selected(current_A__sign="-"))

    page.drop(scope_text(6), "next.csv", bench="bench 4")
    page.drop(run_text(7), "canonical.csv", bench="bench 4")
    page.drop(scope_text(8), "elsewhere.csv", bench="bench 5")
    page.http.post("/pending/confirm")

    stored = {run["file"]: run["mapping"] for run in page.runs()}
    assert set(stored) == {"run.csv", "next.csv", "canonical.csv"}
    assert stored["next.csv"] == stored["run.csv"]
    assert stored["next.csv"]["current_A"]["scale"] == -1.0  # type: ignore[index]
    assert stored["canonical.csv"] is None


def test_bench_and_motor_may_be_named_after_the_files(page: Page) -> None:
    """The mapping of the bench is applied to the files that wait."""
    run = page.drop(scope_text(9), bench="bench 6")
    page.http.post(f"/pending/{run}/mapping", data=selected())
    page.http.post("/pending/confirm")
    page.drop(scope_text(10), "later.csv")

    page.http.post("/pending/labels", data={"motor": "servo 2", "bench": "bench 6"})
    page.http.post("/pending/confirm")

    (later, _) = page.runs()
    assert (later["file"], later["motor"]) == ("later.csv", "servo 2")


def test_file_that_is_a_run_already_is_not_added_again(page: Page) -> None:
    """The same bytes with the same mapping are the same run."""
    page.drop(run_text(11))
    page.http.post("/pending/confirm")
    page.drop(run_text(11), "copy.csv")
    page.http.post("/pending/confirm")

    assert len(page.runs()) == 1
    assert "copy.csv" not in page.shown()


def test_mapping_of_a_stored_run_is_corrected_as_another_run(page: Page) -> None:
    """A stored run never changes, since fits refer to it; the reversed current is a new run."""
    page.drop(run_text(16), motor="servo 3")
    page.http.post("/pending/confirm")
    (before,) = page.runs()
    section = page.http.post(f"/pending/{before['id']}/reopen").text
    copy = section.partition('<article class="pending" id="')[2].partition('"')[0]
    form = {"current_A.column": "current_A", "current_A.was": "current_A", "current_A.sign": "-"}
    page.http.post(f"/pending/{copy}/mapping", data=form)
    page.http.post("/pending/confirm")

    after, unchanged = page.runs()

    assert unchanged == before
    assert (after["id"], after["motor"], after["sha256"]) == (copy, "servo 3", before["sha256"])
    low, high = (before["channels"]["current_A"][end] for end in ("min", "max"))  # type: ignore[index]
    assert after["channels"]["current_A"] == {"min": -high, "max": -low}  # type: ignore[index]


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
        (b"no,run\n", "needs a correction", "already above; discard one of the two"),
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


def board_text(seed: int) -> bytes:
    """Run of a board without times, whose voltage is a magnitude beside the pin of a direction."""
    _, *rows = run_text(seed).decode().splitlines()
    lines = ["voltage_V,current_A,speed_rad_s,dir"]
    for row in rows:
        voltage, current, speed = row.split(",")[1:4]
        lines.append(f"{voltage.lstrip('-')},{current},{speed},{int(not voltage.startswith('-'))}")
    return "\n".join([*lines, ""]).encode()


def test_direction_row_and_constant_are_selected(page: Page) -> None:
    """The form offers what the mapping can supply, and the stored run has this mapping."""
    form = selected(
        time_s__column="row",
        time_s__was="row",
        time_s__factor="0.001",
        voltage_V__column="voltage_V",
        voltage_V__sign="+dir",
        current_A__column="current_A",
        speed_rad_s__column="speed_rad_s",
        temperature_degC__column="=",
        temperature_degC__offset="23",
    )

    shown = [
        page.http.post(f"/pending/{page.drop(board_text(seed))}/mapping", data=form).text
        for seed in (3, 4)
    ]

    for text in shown:
        assert '<option value="+dir" selected>' in text
        assert '<option value="row" selected>' in text
        assert '<option value="=" selected>' in text
        assert "sign_from_direction" in text
    page.http.post("/pending/confirm")
    expected = {
        "time_s": {"column": "row", "unit": "s", "scale": 0.001, "offset": 0.0},
        "voltage_V": {"column": "voltage_V", "sign": "dir"},
        "current_A": {"column": "current_A"},
        "speed_rad_s": {"column": "speed_rad_s"},
        "temperature_degC": {"value": 23.0},
    }
    assert [run["mapping"] for run in page.runs()] == [expected, expected]


def test_constant_is_missing_until_its_value_is_typed(page: Page) -> None:
    """The offset of a column is no value of a constant; 0 degC, typed, is one."""
    run = page.drop(scope_text(9))
    column = selected(voltage_V__offset="0.5")
    page.http.post(f"/pending/{run}/mapping", data=column)
    chosen = column | {"voltage_V.column": "=", "temperature_degC.column": "="}
    both = chosen | {"voltage_V.was": "=", "temperature_degC.was": "="}
    steps = [
        chosen | {"temperature_degC.offset": "0"},
        both | {"voltage_V.offset": "24", "temperature_degC.offset": ""},
        both | {"voltage_V.offset": "24", "temperature_degC.offset": "0"},
    ]

    first, second, last = (page.http.post(f"/pending/{run}/mapping", data=f).text for f in steps)

    assert "needs a correction" in first
    assert "Voltage_V is a constant, but its value is missing; give it as a number in V" in first
    assert "Add 0 runs" in first
    assert "needs a correction" in second
    assert re.search(r'value="24" aria-label="Value of voltage">', second)
    assert re.search(r'value="" aria-label="Value of temperature" class=missing', second)
    assert second.count("<option selected>rpm</option>") == 1
    assert ">ready</span>" in last
    page.http.post("/pending/confirm")
    (stored,) = page.runs()
    assert stored["mapping"]["voltage_V"] == {"value": 24.0, "unit": "V"}  # type: ignore[index]
    assert stored["mapping"]["temperature_degC"] == {"value": 0.0}  # type: ignore[index]
