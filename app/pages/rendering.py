"""Rendering of the page templates, and the static files that the pages load."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

from fastapi.responses import HTMLResponse
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from app.composition import Services
from app.http import HELP_PREFIX

__all__ = ["PLOT_FILES", "STATIC_FILES", "help_prefix", "page"]

STATIC_FILES = Path(__file__).parent / "static"
"""Style sheets and scripts of the pages."""

PLOT_FILES = Path(str(files("identification"))) / "reporting" / "templates" / "vendor"
"""uPlot, as bundled with the report."""

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def help_prefix(services: Services) -> str:
    """Path of the documentation that the service shows; empty if it shows none."""
    return HELP_PREFIX if services.settings.help_dir is not None else ""


def page(
    template: str, *, status: int = 200, headers: dict[str, str] | None = None, **values: Any
) -> HTMLResponse:
    """Render a template, whose name has no ending, with these variables."""
    text = _TEMPLATES.get_template(f"{template}.html.j2").render(
        **{"caller": None, "help": "", **values}
    )
    return HTMLResponse(text, status_code=status, headers=headers)
