"""Mappings of pending runs: columns, units, signs and constants that the user selects."""

from __future__ import annotations

import re

from tests.app.pending import COLUMNS, Page, board_text, scope_text, selected
from tests.app.service import run_text


def test_column_with_the_name_of_a_channel_is_suggested(page: Page) -> None:
    """`T` may be a time too, but `time_s` is one."""
    run = page.drop(scope_text(3).replace(b"t,CH1", b"time_s,CH1"), "scope.csv")
    menu = page.shown().partition(f'id="{run}"')[2].partition("Column of time")[2]
    assert re.search(r"<option[^>]* selected[^>]*>time_s<", menu.partition("</select>")[0])


def test_time_is_suggested_if_another_column_is_the_only_temperature(page: Page) -> None:
    """`T` may be a time or a temperature, `time` only a time."""
    run = page.drop(scope_text(5).replace(b"t,CH1", b"time,CH1"), "scope.csv")
    menu = page.shown().partition(f'id="{run}"')[2].partition("Column of time")[2]
    assert re.search(r"<option[^>]* selected[^>]*>time<", menu.partition("</select>")[0])


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


def test_unit_that_a_file_states_counts_against_the_unit_of_its_bench(page: Page) -> None:
    """The logger was set to rad/s and says so below the names; the saved mapping had rpm."""
    run = page.drop(scope_text(5), bench="bench 7")
    page.http.post(f"/pending/{run}/mapping", data=selected())
    page.http.post("/pending/confirm")
    names, *rows = scope_text(6).decode().splitlines()
    page.drop("\n".join([names, "s,V,A,rad/s,degC", *rows, ""]).encode(), bench="bench 7")
    shown = page.shown()
    page.http.post("/pending/confirm")

    later, before = (run["channels"]["speed_rad_s"]["max"] for run in page.runs())  # type: ignore[index]
    assert later > 5.0 * before
    assert "the mapping of the bench gives rpm and the header rad/s; the header is used" in shown


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
