"""Texts of the HTTP interface: validation of received texts, and the format of times.

Received texts must be printable and of limited length.  PostgreSQL cannot store NUL, UTF-8 cannot
encode lone surrogates, and logs and terminals interpret control characters.  SQLite accepts all of
them, so without this check one request would succeed on one database and fail on the other.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from app.errors import FieldRefused

__all__ = [
    "Documented",
    "Moment",
    "Received",
    "check_text",
    "checked_label",
    "moment",
    "sentence",
    "with_example",
]

_LONGEST = 1000


def check_text(field: str, text: str, longest: int = _LONGEST) -> None:
    """Raise `FieldRefused` for a text of a field that is too long [characters] or not printable."""
    if len(text) > longest or not text.isprintable():
        is_long = len(text) > longest
        found = f"{len(text)} characters" if is_long else "an unprintable character"
        remedy = "shorten the text" if is_long else "remove it"
        raise FieldRefused(
            f"{field}: {found}; expected at most {longest} printable characters; {remedy}", field
        )


def checked_label(field: str, text: str | None) -> str | None:
    """Label such as a motor name, stripped of surrounding blanks; None if empty.

    Raises:
        FieldRefused: The label is too long or not printable.
    """
    if text is None or not text.strip():
        return None
    check_text(field, text.strip(), 200)
    return text.strip()


class Documented(BaseModel):
    """Schema of HTTP whose members are described by the texts below them."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class Received(Documented):
    """JSON request body: known fields only, no type conversion, every text checked."""

    model_config = ConfigDict(extra="forbid", strict=True)

    @model_validator(mode="before")
    @classmethod
    def _check_texts(cls, content: Any) -> Any:
        waiting: list[tuple[str, Any]] = [("", content)]
        while waiting:
            place, value = waiting.pop()
            if isinstance(value, str):
                _check_in_body(place, value)
            elif isinstance(value, list):
                waiting += [(f"{place}{at}.", entry) for at, entry in enumerate(value)]
            elif isinstance(value, dict):
                for name, entry in value.items():
                    _check_in_body(f"{place}a name.", str(name))
                    waiting.append((f"{place}{name}.", entry))
        return content


def _check_in_body(place: str, text: str) -> None:
    try:
        check_text(place.removesuffix("."), text)
    except FieldRefused as error:
        raise ValueError(str(error)) from error


def moment(seconds: float) -> str:
    """Format a time given in seconds since 1970 as ISO 8601 in UTC."""
    text = datetime.fromtimestamp(seconds, UTC).isoformat(timespec="microseconds")
    return text.replace("+00:00", "Z")


Moment = Annotated[str, BeforeValidator(lambda at: at if isinstance(at, str) else moment(at))]
"""Time of a schema as ISO 8601 in UTC, also from seconds since 1970."""


def sentence(message: str) -> str:
    """Message of an error as a sentence of a page."""
    return f"{message[0].upper()}{message[1:]}."


def parts(text: str) -> list[str]:
    """Parts of a field of a form, separated by commas, semicolons or blanks."""
    return re.findall(r"[^\s,;]+", text)


def with_example(example: dict[str, Any]) -> ConfigDict:
    """Model configuration that shows an example in the OpenAPI schema."""
    return ConfigDict(json_schema_extra={"examples": [example]})
