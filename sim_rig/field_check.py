"""Check of the bounds in the types of a parameter struct that is built in code, not decoded."""

from __future__ import annotations

from functools import cache
from typing import get_type_hints

import msgspec


def check_fields(struct: msgspec.Struct) -> None:
    """Check every field against the bounds of its type (msgspec.Meta).

    Raises ValueError naming key, value and bound; the next step is the description of the Meta.
    """
    for key, kind in _field_types(type(struct)).items():
        value = getattr(struct, key)
        try:
            msgspec.convert(value, kind)
        except msgspec.ValidationError as error:
            reason = str(error)
            reason = reason[0].lower() + reason[1:]
            raise ValueError(f"{key} = {value!r}: {reason}: {_advice(kind)}") from None


@cache
def _field_types(kind: type) -> dict[str, object]:
    return get_type_hints(kind, include_extras=True)


def _advice(kind: object) -> str:
    """Return the next step for a wrong value of a type."""
    for meta in getattr(kind, "__metadata__", ()):
        if meta.description:
            return str(meta.description)
    return "give a value of this type"
