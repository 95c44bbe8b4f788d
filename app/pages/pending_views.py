"""View models of pending runs: what was understood of a file, and the fields that correct it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from app.pages.mapping_form import CHANNELS, OPTIONAL
from app.pages.views import duration, located, span
from app.tables import PendingRow

__all__ = ["finding_view", "pending_list_view", "pending_view"]

_FACTORS = ("duty", "bus_voltage_V")
_SCALED = re.compile(r"(?P<header>.*) \* (?P<factor>\S+)(?: in (?P<unit>\S+))?")
"""Mapping without offset and period, as the checks propose it."""

_STATES = {
    "ready": "ready",
    "contradictory": "contradictory",
    "unreadable": "needs a correction",
}


def pending_list_view(rows: Sequence[PendingRow]) -> dict[str, Any]:
    """View of all pending runs."""
    readable = [row for row in rows if row.found["summary"] is not None]
    return {
        "runs": [pending_view(row) for row in rows],
        "readable": len(readable),
        "motor": next((row.motor for row in rows if row.motor), ""),
        "bench": next((row.bench for row in rows if row.bench), ""),
    }


def pending_view(row: PendingRow) -> dict[str, Any]:
    """View of one pending run."""
    preview, summary = row.found["preview"], row.found["summary"]
    is_contradictory = any(f["severity"] == "refuse" for f in preview["findings"])
    state = "contradictory" if is_contradictory else "ready"
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
        "state_text": _STATES[state],
        "facts": [] if summary is None else _facts(summary),
        "errors": [
            {
                "text": located(error) + _remedy(error.get("examples", [])),
                "code": error["code"],
            }
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
                row.found["columns"],
                summary,
                is_required=name not in OPTIONAL and not (name == "voltage_V" and "duty" in chosen),
            )
            for name in CHANNELS
            if name not in _FACTORS or is_product
        ],
        "has_columns": bool(row.found["columns"]),
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
    label = CHANNELS.get(finding["column"] or "", "")
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
    label = CHANNELS[place.rpartition(":")[2]].lower()
    found = _SCALED.fullmatch(source)
    if found is None:
        return f"{label} from {source or 'no column'}"
    factor = float(found["factor"])
    parts = [f"{label} from column {found['header']}", f"sign {'−' if factor < 0.0 else '+'}"]
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
    # Lazy import: numpy would slow down every start.
    from identification.ingest.units import UNITS, canonical_unit

    column, unit = entry.get("column", ""), entry.get("unit", "")
    titles = list(dict.fromkeys(column["title"] for column in columns))
    if column and column not in titles:
        # A column of the mapping that the file lacks stays visible next to the error.
        titles.append(column)
    scale = float(entry.get("scale", 1.0))
    found = (summary or {}).get("channels", {}).get(name)
    header = next((c["unit"] for c in columns if c["title"] == column), None)
    return {
        "name": name,
        "label": CHANNELS[name],
        "column": column,
        "titles": titles,
        "unit": unit,
        "units": [u.name for u in UNITS if u.quantity == canonical_unit(name).quantity],
        "header_unit": header,
        "is_negative": scale < 0.0,
        "factor": f"{abs(scale):.12g}",
        "offset": f"{float(entry.get('offset', 0.0)):.12g}",
        "range": span(name, found["min"], found["max"]) if found else "",
        "is_required": is_required,
    }
