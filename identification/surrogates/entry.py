"""Reconstruction of a term from an entry of `effects` in result.json.

A result may have been edited or written elsewhere.  Each error therefore names the missing or
wrong setting of the entry.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any, Final

from identification.effects.catalogue import CATALOGUE
from identification.errors import InputError
from identification.model.term import AbstractTerm
from identification.surrogates.unlisted import unlisted_form, unlisted_term

__all__ = ["term_of"]

_REMEDY: Final = "use the unchanged result.json of 'motorid fit', or repeat the fit"
_KINDS: Final[dict[str, tuple[tuple[type, ...], str]]] = {
    "float": ((Real, type(None)), "a number"),
    "int": ((Integral, type(None)), "an integer"),
    "bool": ((bool,), "true or false"),
    "tuple": ((list, tuple), "a list"),
    "str": ((str,), "a text"),
    "Literal": ((str,), "a text"),
}
"""JSON types of a field and their name in messages, by the first word of the annotation."""


def term_of(entry: object) -> AbstractTerm:
    """The term that an entry of `effects` describes.

    Args:
        entry: The entry, with `name`, `settings` and, for the effect `unlisted`, `equation`.

    Raises:
        InputError: The entry has no name, the effect is unknown, or a setting is missing, unknown
            or of the wrong type.
    """
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise InputError(f"an effect of the result has no name; {_REMEDY}", value=entry)
    name, settings = entry["name"], entry.get("settings", {})
    if not isinstance(settings, Mapping):
        raise InputError(
            f"the settings of the effect {name} are not an object; {_REMEDY}", value=name
        )
    if name == "unlisted":
        form = unlisted_form(entry.get("equation"), settings)
        if form is None:
            raise InputError(
                "the effect unlisted has no law with the settings "
                f"{', '.join(map(str, settings)) or 'none'}; {_REMEDY}",
                value=name,
            )
        _check_settings(name, form, settings)
        return unlisted_term(entry["equation"], dict(settings))
    kind = CATALOGUE.get(name)
    if kind is None:
        raise InputError(
            f"effect {name!r} is not known; expected one of {', '.join(CATALOGUE)}", value=name
        )
    laws = (kind, *kind.laws)
    kind = next((law for law in laws if _fields(law) == set(settings)), kind)
    _check_settings(name, kind, settings)
    fields = {k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()}
    term: AbstractTerm = kind(**fields)
    return term


def _fields(kind: Any) -> set[str]:
    return {field.name for field in dataclasses.fields(kind)}


def _check_settings(name: str, kind: Any, settings: Mapping[str, Any]) -> None:
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for field in fields.values():
        if field.name not in settings and field.default is dataclasses.MISSING:
            raise InputError(
                f"the effect {name} of the result lacks the setting {field.name}; {_REMEDY}",
                value=name,
            )
    for key, value in settings.items():
        if key not in fields:
            raise InputError(
                f"the effect {name} of the result has the setting {key!r}; expected "
                f"{', '.join(fields) or 'none'}",
                value=key,
            )
        # The annotation is a string, since `from __future__ import annotations` is in effect.
        word = str(fields[key].type).split("[")[0].split(" ")[0]
        types, expected = _KINDS[word]
        if not isinstance(value, types) or (isinstance(value, bool) and word != "bool"):
            raise InputError(
                f"the effect {name} of the result has the setting {key} {str(value)[:60]!r}; "
                f"expected {expected}",
                value=value,
            )
