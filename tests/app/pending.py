"""Pending runs of the start page: files whose columns the header does not name, and the page."""

from __future__ import annotations

import httpx

from tests.app.service import Server, make_key, run_text

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


def board_text(seed: int) -> bytes:
    """Run of a board without times, whose voltage is a magnitude beside the pin of a direction."""
    _, *rows = run_text(seed).decode().splitlines()
    lines = ["voltage_V,current_A,speed_rad_s,dir"]
    for row in rows:
        voltage, current, speed = row.split(",")[1:4]
        lines.append(f"{voltage.lstrip('-')},{current},{speed},{int(not voltage.startswith('-'))}")
    return "\n".join([*lines, ""]).encode()
