"""Pending runs on the start page: what was understood of a file, and corrections of its mapping."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final

from anyio import to_thread
from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse

from app.access.service import Caller
from app.composition import Services
from app.http import PENDING_PATH
from app.http.dependencies import CallerDep, ServicesDep
from app.pages.forms import number, texts_of
from app.pages.rendering import Page
from app.pages.views import duration, located, span
from app.runs.endpoints import received
from app.runs.upload import LONGEST_FIELD
from app.tables import PendingRow

__all__ = ["finding_view", "pending_list_view", "pending_view", "router"]

router = APIRouter(prefix=PENDING_PATH, include_in_schema=False)

_FIELDS = {"motor": LONGEST_FIELD, "bench": LONGEST_FIELD}

Label = Annotated[str, Form(max_length=LONGEST_FIELD)]

_CHANNELS: Final = {
    "time_s": "Time",
    "voltage_V": "Voltage",
    "current_A": "Current",
    "speed_rad_s": "Speed",
    "temperature_degC": "Temperature",
    "position_rad": "Shaft angle",
    "duty": "Duty cycle",
    "bus_voltage_V": "Bus voltage",
}
"""Channels with the names that the pages show."""

CONSTANT: Final = "="
"""Entry of the menu of columns for a constant."""

_OPTIONAL: Final = ("temperature_degC", "position_rad", "duty", "bus_voltage_V")
"""Channels that a run may lack."""

_FACTORS = ("duty", "bus_voltage_V")
_SCALED = re.compile(r"(?P<header>.*) \* (?P<factor>-?\d\S*)(?: in (?P<unit>\S+))?")
"""Mapping without offset and period, as the checks propose it."""

_STATES = {
    "ready": "ready",
    "contradictory": "contradictory",
    "unreadable": "needs a correction",
    "known": "already added",
}


@router.get("")
def show_all(page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """All pending runs."""
    return _section(page, services, caller)


@router.post("")
async def add(
    request: Request, page: Page, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Receive and examine one file."""
    services.reading.check()
    async with received(request, services, _FIELDS) as upload:
        row = await services.reading.run(services.pending.add, caller, upload)
    known = await to_thread.run_sync(services.pending.known, caller, [row])
    return page("pending_run", run=pending_view(row, is_known=row.id in known))


@router.post("/labels")
async def relabel(
    page: Page, services: ServicesDep, caller: CallerDep, motor: Label = "", bench: Label = ""
) -> HTMLResponse:
    """Set motor and bench of all pending runs."""
    services.reading.check()
    await services.reading.run(services.pending.relabel, caller, motor, bench)
    return await to_thread.run_sync(_section, page, services, caller)


@router.post("/confirm")
async def confirm(services: ServicesDep, caller: CallerDep) -> Response:
    """Make runs of all pending runs that can be read, and show the start page with them."""
    services.reading.check()
    await services.reading.run(services.pending.confirm, caller)
    return RedirectResponse("/", status_code=303)


@router.post("/{run_id}/reopen")
async def reopen(run_id: str, page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Make a pending run of a stored run, to correct its mapping."""
    services.reading.check()
    await services.reading.run(services.pending.reopen, caller, run_id)
    return await to_thread.run_sync(_section, page, services, caller)


@router.post("/{run_id}/mapping")
async def correct(
    run_id: str, page: Page, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Examine a pending run with the mapping selected in its form."""
    row = await to_thread.run_sync(services.pending.get, caller, run_id)
    mapping = _mapping_from(await texts_of(request), row.mapping or {})
    services.reading.check()
    row = await services.reading.run(services.pending.correct, caller, run_id, mapping)
    pending = await to_thread.run_sync(pending_list_view, services, caller)
    run = next((run for run in pending["runs"] if run["id"] == run_id), pending_view(row))
    # The button above the list counts the runs that can be added now.
    return page("pending_corrected", run=run, pending=pending)


@router.delete("")
def discard_all(page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Discard all pending runs."""
    services.pending.discard_all(caller)
    return _section(page, services, caller)


@router.delete("/{run_id}")
def discard(run_id: str, page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Discard a pending run."""
    services.pending.discard(caller, run_id)
    return _section(page, services, caller)


@router.get("/{run_id}/samples")
def samples(run_id: str, services: ServicesDep, caller: CallerDep) -> JSONResponse:
    """Samples to plot, in SI units."""
    return JSONResponse(services.pending.get(caller, run_id).found["samples"])


def _section(page: Page, services: Services, caller: Caller) -> HTMLResponse:
    return page("pending", pending=pending_list_view(services, caller))


def pending_list_view(services: Services, caller: Caller) -> dict[str, Any]:
    """View of all pending runs."""
    rows = services.pending.all(caller)
    known = services.pending.known(caller, rows)
    readable = [row for row in rows if row.found["summary"] is not None]
    return {
        "runs": [pending_view(row, is_known=row.id in known) for row in rows],
        "new": sum(row.id not in known for row in readable),
        "motor": next((row.motor for row in rows if row.motor), ""),
        "bench": next((row.bench for row in rows if row.bench), ""),
    }


def pending_view(row: PendingRow, *, is_known: bool = False) -> dict[str, Any]:
    """View of one pending run, known if its file and mapping are those of another one."""
    preview, summary, columns = (row.found[name] for name in ("preview", "summary", "columns"))
    is_contradictory = any(f["severity"] == "refuse" for f in preview["findings"])
    state = "contradictory" if is_contradictory else "ready"
    if is_known:
        state = "known"
    if summary is None:
        state = "unreadable"
    suggested = {name: {"column": title} for name, title in row.found["suggested"].items()}
    chosen = preview["mapping"] if summary is not None else suggested | (row.mapping or {})
    # The warnings of a run repeat its contradictions.
    found = {finding["code"] for finding in preview["findings"]}
    # Duty and bus voltage stand for a voltage without a column of its own.
    is_product = "voltage_V" not in chosen
    return {
        "id": row.id,
        "file": row.file,
        "state": state,
        "state_text": _STATES[state] if state != "unreadable" or columns else "cannot be read",
        "is_known": is_known,
        "facts": [] if summary is None else _facts(summary),
        "errors": [
            {"text": located(error) + _remedy(error.get("examples", [])), "code": error["code"]}
            for error in preview["errors"]
        ],
        "findings": [finding_view(finding) for finding in preview["findings"]],
        "warnings": [
            {"text": located(warning), "code": warning["code"]}
            for warning in (summary or {}).get("warnings", ())
            if warning["code"] not in found
        ],
        "channels": [
            _channel(
                name,
                chosen.get(name) or {},
                columns,
                summary,
                is_required=name not in _OPTIONAL
                and not (name == "voltage_V" and "duty" in chosen),
            )
            for name in _CHANNELS
            if name not in _FACTORS or is_product
        ],
        "has_columns": bool(columns),
        "has_plot": summary is not None,
    }


def _remedy(examples: Sequence[Mapping[str, Any]]) -> str:
    """Remedy on the page for a fault that a mapping corrects."""
    if not examples:
        return ""
    text = json.dumps(examples[0], ensure_ascii=False)
    # The page has fields for all of a mapping except the period.
    if '"period":' in text:
        return f", or upload it by HTTP with the mapping {text}"
    return ", or select it below"


def _facts(summary: Mapping[str, Any]) -> list[str]:
    return [
        f"{summary['rows']:,} samples".replace(",", "\u202f"),
        f"{summary['sample_rate_hz']:.4g} Hz",
        duration(summary["duration_s"]),
    ]


def finding_view(finding: Mapping[str, Any]) -> dict[str, Any]:
    """View of a contradiction with its corrections in the fields of the page."""
    label = _CHANNELS.get(finding["column"] or "", "")
    return {
        "file": finding["file"],
        "is_refused": finding["severity"] == "refuse",
        "text": f"{label}: {finding['message']}" if label else finding["message"],
        "corrections": [_correction(words) for words in finding["corrections"]],
        "code": finding["code"],
    }


def _correction(words: str) -> str:
    """Correction in the fields of the page, from ``FILE:CHANNEL=HEADER * FACTOR in UNIT``."""
    place, _, source = words.partition("=")
    label = _CHANNELS[place.rpartition(":")[2]].lower()
    found = _SCALED.fullmatch(source)
    if found is None:
        return f"{label} from {source.replace(' * ', ' × ') or 'no column'}"
    factor = float(found["factor"])
    header = found["header"].replace(" * ", " × ")
    parts = [f"{label} from column {header}", f"sign {'−' if factor < 0.0 else '+'}"]
    parts += [f"unit {found['unit']}"] if found["unit"] else []
    parts += [f"factor {abs(factor):.12g}"] if abs(factor) != 1.0 else []
    return ", ".join(parts)


def _channel(
    name: str,
    entry: Mapping[str, Any],
    columns: Sequence[Mapping[str, Any]],
    summary: Mapping[str, Any] | None,
    *,
    is_required: bool,
) -> dict[str, Any]:
    """Fields of one channel, with the options of its menus."""
    # Lazy import: pandas would slow down every start.
    from identification.ingest.mapping import CONSTANTS, ROW, SIGNED
    from identification.ingest.units import UNITS, canonical_unit

    column, unit = entry.get("column", CONSTANT if "value" in entry else ""), entry.get("unit", "")
    titles = list(dict.fromkeys(column["title"] for column in columns))
    if column not in ("", CONSTANT, *titles) and (name, column) != ("time_s", ROW):
        # A column of the mapping that the file lacks stays visible next to the error.
        titles.append(column)
    scale = float(entry.get("scale", 1.0))
    offset = entry.get("value", entry.get("offset", 0.0))
    found = (summary or {}).get("channels", {}).get(name)
    header = next((c["unit"] for c in columns if c["title"] == column), None)
    is_row = name == "time_s" and column == ROW
    if is_row or column == CONSTANT:
        header = header or canonical_unit(name).name
    return {
        "name": name,
        "label": _CHANNELS[name],
        "column": column,
        "titles": titles,
        "unit": unit,
        "units": [u.name for u in UNITS if u.quantity == canonical_unit(name).quantity],
        "header_unit": header,
        "is_negative": scale < 0.0,
        "may_be_constant": name in CONSTANTS,
        "is_row": is_row,
        "direction": entry.get("sign", ""),
        "directions": [
            column["title"] for column in columns if name in SIGNED and column["unit"] is None
        ],
        "factor": f"{abs(scale):.12g}",
        "offset": "" if offset is None else f"{float(offset):.12g}",
        "range": span(name, found["min"], found["max"]) if found else "",
        "is_required": is_required,
    }


def _mapping_from(form: Mapping[str, str], earlier: Mapping[str, Any]) -> dict[str, Any] | None:
    """Mapping selected in a form, given the one before.

    The fields are `CHANNEL.column`, `.was` (the column before), `.unit`, `.sign`, `.factor` and
    `.offset`.  The sign is + or -, with the column of a direction behind it; the offset of a
    constant is its value, which is None until it is typed: the offset of a column is no value.

    The unit belongs to the column: if another column is selected, its header gives the unit.  A
    channel without a column is left to the header, unless the user has removed its column.

    Raises:
        FieldRefused: A factor or an offset is not a finite number.
    """
    mapping: dict[str, Any] = {}
    for channel in _CHANNELS:
        column, was = (form.get(f"{channel}.{field}", "") for field in ("column", "was"))
        if not column:
            if channel in _OPTIONAL and (was or earlier.get(channel, "") is None):
                mapping[channel] = None
            continue
        entry: dict[str, Any] = {"column": column}
        if column == was and form.get(f"{channel}.unit"):
            entry["unit"] = form[f"{channel}.unit"]
        scale = number(f"{channel}.factor", form.get(f"{channel}.factor", ""), 1.0)
        sign = form.get(f"{channel}.sign", "")
        scale *= -1.0 if sign[:1] == "-" else 1.0
        typed = form.get(f"{channel}.offset", "")
        offset = number(f"{channel}.offset", typed, 0.0)
        before = earlier.get(channel) or {}
        if column == CONSTANT:
            del entry["column"]
            is_of_column = was != CONSTANT and offset == before.get("offset", 0.0)
            value = None if is_of_column or not typed.strip() else offset
            mapping[channel] = {"value": value, **entry}
            continue
        if sign[1:]:
            entry["sign"] = sign[1:]
        if (scale, offset) != (1.0, 0.0):
            entry |= {"scale": scale, "offset": offset}
        if column == was and "period" in before:
            entry["period"] = before["period"]
        mapping[channel] = entry
    return mapping or None
