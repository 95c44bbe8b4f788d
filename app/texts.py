"""Texts of callers: one rule for those in a query, a header, a form or a JSON body.

A text is printable and of bounded length.  PostgreSQL keeps no NUL, UTF-8 has no lone surrogates,
and a log or a terminal obeys control characters; SQLite takes all of them, so that the same request
would be an answer at one service and an internal error at another.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from app.errors import FieldRefused

__all__ = ["Received", "check_text", "checked_label"]

_LONGEST = 1000


def check_text(field: str, text: str, longest: int = _LONGEST) -> None:
    """Refuse a text that is too long or holds what cannot be printed.

    Args:
        field: Where in the request it stands.
        text: The text.
        longest: Most characters of it.

    Raises:
        FieldRefused: The text is not accepted.
    """
    if len(text) > longest or not text.isprintable():
        raise FieldRefused(f"{field}: expected at most {longest} printable characters", field)


def checked_label(field: str, text: str | None) -> str | None:
    """A label such as the name of a motor, without blanks around it; None for an empty one.

    Raises:
        FieldRefused: It is too long or holds something that cannot be printed.
    """
    if text is None or not text.strip():
        return None
    check_text(field, text.strip(), 200)
    return text.strip()


class Received(BaseModel):
    """A JSON body: only known fields, no conversion of types, and every text checked."""

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
        raise ValueError(error.message) from error
