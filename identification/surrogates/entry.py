"""Reconstruction of a term from an entry of `effects` in result.json.

A result may have been edited or written elsewhere.  Each error therefore names the missing or
wrong setting of the entry.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from types import UnionType
from typing import Final, Literal, get_args, get_origin, get_type_hints

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import AbstractEffect
from identification.errors import InputError
from identification.surrogates.unlisted import LAWS, SURROGATES

__all__ = ["term_of"]

_REMEDY: Final = "use the unchanged result.json of 'motorid fit', or repeat the fit"
_JSON: Final[Mapping[object, tuple[tuple[type, ...], str]]] = {
    float: ((Real, type(None)), "a number"),
    int: ((Integral, type(None)), "an integer"),
    bool: ((bool,), "true or false"),
    tuple: ((list, tuple), "a list"),
    str: ((str,), "a text"),
    Literal: ((str,), "a text"),
}
"""JSON types of a field and their name in messages, by the type of the field."""


def term_of(entry: object) -> AbstractEffect:
    """The term that an entry of `effects` describes, by `name`, `settings` and `equation`.

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
        law = _law(
            [k for k in (*SURROGATES, *LAWS) if k.equation == entry.get("equation")], settings
        )
        if law is None:
            raise InputError(
                "the effect unlisted has no law with the settings "
                f"{', '.join(map(str, settings)) or 'none'}; {_REMEDY}",
                value=name,
            )
    elif name in CATALOGUE:
        kind = CATALOGUE[name]
        law = _law((kind, *kind.laws), settings) or kind
    else:
        raise InputError(
            f"effect {name!r} is not known; expected one of {', '.join(CATALOGUE)}", value=name
        )
    _check_settings(name, law, settings)
    return law(**{key: _without_lists(value) for key, value in settings.items()})


def _law(
    laws: Sequence[type[AbstractEffect]], settings: Mapping[str, object]
) -> type[AbstractEffect] | None:
    """The law with exactly these settings, or with these and defaults, or None."""
    defaults = []
    for law in laws:
        fields = {field.name: field.default for field in dataclasses.fields(law)}
        if set(fields) == set(settings):
            return law
        needed = {name for name, default in fields.items() if default is dataclasses.MISSING}
        defaults += [law] if needed <= set(settings) <= set(fields) else []
    return next(iter(defaults), None)


def _without_lists(value: object) -> object:
    """The value with tuples in place of lists."""
    return tuple(map(_without_lists, value)) if isinstance(value, list | tuple) else value


def _check_settings(name: str, law: type[AbstractEffect], settings: Mapping[str, object]) -> None:
    fields, types = dataclasses.fields(law), get_type_hints(law)
    for field in fields:
        if field.name not in settings and field.default is dataclasses.MISSING:
            raise InputError(
                f"the effect {name} of the result lacks the setting {field.name}; {_REMEDY}",
                value=name,
            )
    names = [field.name for field in fields]
    for key, value in settings.items():
        if key not in names:
            raise InputError(
                f"the effect {name} of the result has the setting {key!r}; expected "
                f"{', '.join(names) or 'none'}",
                value=key,
            )
        accepted, expected = _JSON[_plain(types[key])]
        if not isinstance(value, accepted) or (isinstance(value, bool) and bool not in accepted):
            raise InputError(
                f"the effect {name} of the result has the setting {key} {str(value)[:60]!r}; "
                f"expected {expected}",
                value=value,
            )


def _plain(hint: object) -> object:
    """Type of a field without its arguments, and the first type of a union."""
    return get_args(hint)[0] if isinstance(hint, UnionType) else get_origin(hint) or hint
