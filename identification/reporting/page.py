"""Self-contained HTML pages: template engine, assets and content security policy.

The template engine escapes all external text.  The policy admits only the page's own scripts and
styles, by their hashes.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from functools import cache
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from identification.result.effect_texts import effect_words
from identification.result.numbers import (
    UNKNOWN,
    count_text,
    number_text,
    percent_text,
    probability_text,
    signed_percent_text,
    unit_text,
)

__all__ = ["asset", "page_environment", "page_policy"]


@cache
def page_environment(package: str) -> Environment:
    """Template engine for the folder ``templates`` of a package, with filters for numbers."""
    environment = Environment(
        loader=PackageLoader(package),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number_text,
        "percent": percent_text,
        "plain": lambda value: UNKNOWN if value is None else f"{value:.6g}",
        "probability": probability_text,
        "change": signed_percent_text,
        "signed": lambda value: f"{value:+.1f}".replace("-", "−"),
        "count": count_text,
        "unit": unit_text,
        "capital": lambda text: text[:1].upper() + text[1:],
        "words": effect_words,
    }
    return environment


@cache
def asset(package: str, name: str) -> Markup:
    """Content of a file in the folder ``templates``, inserted unchanged into the page."""
    folder = resources.files(package) / "templates"
    return Markup(folder.joinpath(name).read_text("utf-8"))


def page_policy(styles: Sequence[str], scripts: Sequence[str] = ()) -> str:
    """Content security policy that admits these styles and scripts, and images as data URLs."""
    sources = {"script-src": scripts, "style-src": styles}
    own = "".join(f"{name} {' '.join(map(_hash, one))}; " for name, one in sources.items() if one)
    return f"default-src 'none'; {own}img-src data:; base-uri 'none'; form-action 'none'"


def _hash(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
