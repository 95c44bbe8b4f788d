"""Hooks of mkdocs: pages generated from the code, and links that leave the documentation.

The references of Python, HTTP and the result exist on the site only; they are generated from
`identification.__all__` and its docstrings, from the OpenAPI document of the service and from the
JSON Schema of the result.
"""

from __future__ import annotations

import posixpath
import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import identification
from app.main import create_app
from app.settings import load_settings
from identification.result.schema import result_schema

Schema = Mapping[str, Any]

_LINK = re.compile(r"\[([^\]]+)\]\(((?:\.\./)+[^)\s]+)\)")


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the generated references."""
    for name, content in (
        ("python-reference.md", python_reference()),
        ("http-reference.md", http_reference()),
        ("result-reference.md", result_reference()),
    ):
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace links to files outside of docs/, such as sources, by their path."""

    def replaced(link: re.Match[str]) -> str:
        text, target = link.groups()
        path = posixpath.normpath(
            posixpath.join("docs", posixpath.dirname(page.file.src_uri), target)
        )
        if path.startswith("docs/"):
            return link[0]
        if not (Path(config.config_file_path).parent / path).exists():
            raise ValueError(f"{page.file.src_uri} links {target}, which does not exist")
        return f"{text} (`{path}`)"

    return _LINK.sub(replaced, markdown)


def python_reference() -> str:
    """All public names of the library, functions first, by directives of mkdocstrings."""
    names = sorted(identification.__all__, key=lambda name: (name[0].isupper(), name))
    functions = [name for name in names if name[0].islower()]
    classes = [name for name in names if name[0].isupper()]
    errors = [name for name in classes if issubclass(getattr(identification, name), Exception)]
    sections = [
        ("Functions", functions),
        ("Classes", [name for name in classes if name not in errors]),
        ("Errors", errors),
    ]
    lines = [
        "# Python reference",
        "",
        "Generated from the docstrings of `identification`; [Python library](library.md) is the "
        "introduction.",
    ]
    for title, members in sections:
        lines += ["", f"## {title}"]
        for name in members:
            lines += ["", f"::: {getattr(identification, name).__module__}.{name}"]
    return "\n".join(lines) + "\n"


def http_reference() -> str:
    """Every call of the service with parameters, body and answers, from its OpenAPI document."""
    with tempfile.TemporaryDirectory() as directory:
        document = create_app(load_settings(data_dir=Path(directory))).openapi()
    lines = [
        "# HTTP reference",
        "",
        "Generated from the OpenAPI document, which the service serves as "
        "`/api/v1/openapi.json`; [HTTP](http.md) is the introduction.",
    ]
    for path, calls in document["paths"].items():
        for method, call in calls.items():
            lines += ["", f"## {method.upper()} {path}", "", call.get("summary", "")]
            lines += ["", _paragraphs(call.get("description", ""))]
            lines += _parameters(call.get("parameters", []))
            lines += _body(call.get("requestBody"))
            lines += ["", "| status | answer |", "|---|---|"]
            lines += [
                f"| {status} | {_cell(answer.get('description', ''))}{_content(answer)} |"
                for status, answer in call["responses"].items()
            ]
    lines += ["", "## Objects"]
    for name, schema in document["components"]["schemas"].items():
        lines += ["", f"### {name}", "", _paragraphs(schema.get("description", ""))]
        lines += _members(schema)
    return "\n".join(lines) + "\n"


def result_reference() -> str:
    """Members of result.json from its JSON Schema."""
    schema = result_schema()
    lines = [
        "# result.json reference",
        "",
        f"Generated from the JSON Schema `{schema['$id']}`; [result.json](result-json.md) explains "
        "the members.",
        *_members(schema),
    ]
    for name, definition in schema["$defs"].items():
        lines += ["", f"## {name}", "", _paragraphs(definition.get("description", ""))]
        lines += _members(definition)
    return "\n".join(lines) + "\n"


def _parameters(parameters: list[Schema]) -> list[str]:
    if not parameters:
        return []
    rows = [
        f"| `{one['name']}` | {one['in']} | {_type(one['schema'])} | "
        f"{_cell(one.get('description') or one['schema'].get('description', ''))} |"
        for one in parameters
    ]
    return ["", "| parameter | in | type | meaning |", "|---|---|---|---|", *rows]


def _body(body: Schema | None) -> list[str]:
    if body is None:
        return []
    lines = ["", f"Body: {_content(body).lstrip()}."]
    for content in body["content"].values():
        lines += _members(content.get("schema") or {})
    return lines


def _content(holder: Schema) -> str:
    """Media types of a body or an answer; those with the same schema together."""
    kinds: dict[str, list[str]] = {}
    for kind, content in (holder.get("content") or {}).items():
        kinds.setdefault(_type(content.get("schema") or {}), []).append(f"`{kind}`")
    texts = [
        ", ".join(names) + ("" if schema == "any" else f" ({schema})")
        for schema, names in kinds.items()
    ]
    return f" {'; '.join(texts)}" if texts else ""


def _members(schema: Schema) -> list[str]:
    rows = list(_rows(schema.get("properties") or {}, set(schema.get("required", ())), ""))
    if not rows:
        return []
    return ["", "| member | type | always | meaning |", "|---|---|---|---|", *rows]


def _rows(properties: Schema, required: set[str], within: str) -> Iterator[str]:
    for name, schema in properties.items():
        always = "yes" if name in required else ""
        meaning = _cell(schema.get("description", ""))
        yield f"| `{within}{name}` | {_type(schema)} | {always} | {meaning} |"
        inner = schema.get("items", schema) if schema.get("type") == "array" else schema
        mark = "[]." if inner is not schema else "."
        yield from _rows(
            inner.get("properties") or {}, set(inner.get("required", ())), f"{within}{name}{mark}"
        )


def _type(schema: Schema) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " or ".join(_type(one) for one in schema[key])
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items') or {})}"
    kind = schema.get("type", "any")
    return " or ".join(kind) if isinstance(kind, list) else str(kind)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _paragraphs(text: str) -> str:
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))
