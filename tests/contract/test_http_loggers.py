"""Files of loggers and monitors over HTTP and on the page: preview, menus, mapping and storage."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from app.cli import main
from tests.app.pending import Page
from tests.app.service import Caller, Server
from tests.ingest.loggers import LOGGERS
from tests.ingest.writers import RECORD, Specimen, rows

PLOTTER = "\n".join(f"U:{r[1]} I:{r[2]} n:{r[3]}" for r in rows()) + "\n"
LONG = "time;signal;value\n" + "".join(
    f"{r[0]};{name};{value}\n" for r in rows() for name, value in zip("UIn", r[1:4], strict=True)
)
UNITS = {
    "voltage_V": {"column": "U", "unit": "V"},
    "current_A": {"column": "I", "unit": "A"},
    "speed_rad_s": {"column": "n", "unit": "rad/s"},
}
ROW = {"column": "row", "scale": 0.001}


ONE_OF_EACH_KIND = ("graphtec.csv", "long.csv", "units.csv")


@pytest.mark.parametrize(
    "specimen", [s for s in LOGGERS if s.name in ONE_OF_EACH_KIND], ids=lambda s: s.name
)
def test_preview_of_a_logger_is_what_the_command_prints(
    alice: Caller, tmp_path: Path, capsys: pytest.CaptureFixture[str], specimen: Specimen
) -> None:
    """With the mapping where the file needs one; that the run is short is the only fault."""
    path = specimen.made(tmp_path)
    mapping = json.dumps(specimen.mapping or {})
    (tmp_path / "mapping.json").write_text(mapping)
    files = {"file": (path.name, path.read_bytes())}
    answer = alice.http.post("/runs/preview", files=files, data={"mapping": mapping}).json()

    main(["check", str(path), "--mapping", str(tmp_path / "mapping.json"), "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert answer == {name: printed[name] for name in printed if name != "schema_version"}
    assert set(answer["mapping"]) == set(RECORD)
    (error,) = answer["errors"]
    assert "40 samples together" in error["message"]


@pytest.mark.parametrize("content", [PLOTTER, LONG], ids=["labels", "one signal a row"])
def test_names_without_units_are_asked_for_and_stored_as_mapped(
    alice: Caller, content: str
) -> None:
    """The errors name each label; with units, and a time where there is none, the run is stored."""
    time = ROW if content is PLOTTER else {"column": "time", "unit": "s"}
    files = {"file": ("monitor.txt", content.encode())}

    before = alice.http.post("/runs/preview", files=files).json()
    stored = alice.http.post(
        "/runs", files=files, data={"mapping": json.dumps({"time_s": time, **UNITS})}
    )

    assert before["accepted"] is False
    named = {error["column"] for error in before["errors"]}
    assert {"U", "I", "n"} <= named
    assert stored.status_code == 201, stored.text
    assert stored.json()["rows"] == len(RECORD["time_s"])


@pytest.mark.parametrize("content", [PLOTTER, LONG], ids=["labels", "one signal a row"])
def test_menus_offer_the_signals_and_a_selection_makes_a_run(server: Server, content: str) -> None:
    """The labels, or the names in the rows, are the columns of the page."""
    with Page(server, f"logger-{len(content)}") as page:
        run = page.drop(content.encode(), "monitor.txt")
        shown = page.shown()
        form: dict[str, str] = {}
        for channel, entry in UNITS.items():
            column, unit = entry["column"], entry["unit"]
            form |= {f"{channel}.column": column, f"{channel}.was": column, f"{channel}.unit": unit}
        time = "row" if content is PLOTTER else "time"
        form |= {"time_s.column": time, "time_s.was": time}
        form |= {"time_s.factor": "0.001"} if content is PLOTTER else {"time_s.unit": "s"}
        page.http.post(f"/pending/{run}/mapping", data=form)
        page.http.post("/pending/confirm")
        (stored,) = page.runs()

    assert {"U", "I", "n"} <= set(re.findall(r"<option[^>]*>([^<]*)</option>", shown))
    assert "value</option>" not in shown
    assert stored["rows"] == len(RECORD["time_s"])
