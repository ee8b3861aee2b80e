"""TOML files: tables in, structs out.

An error names section, key, value, bound and the nearest known key.
"""

from __future__ import annotations

import difflib
import json
import re
import tomllib
import warnings
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from rig.errors import ConfigError, RenamedKey
from rig.run.units import key_unit, other_unit, without_unit

T = TypeVar("T")
MAX_DEPTH = 32  # tables and lists within each other; the files of this program need 4


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Table of a file; an unknown key is an error."""


def convert(data: Any, kind: type[T], section: str = "") -> T:
    """Convert data to kind; raises ConfigError that names section, key, value and bound."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(_explain(str(error), data, kind, section)) from None


def rename_keys(tables: dict[str, Any], new_names: dict[str, str], section: str = "") -> None:
    """Move the tables of old names to their new names, with a RenamedKey warning for each.

    section: what stands before these names in the file, e.g. "links.". Raises ConfigError for a
    file that has a table under both names.
    """
    for old, new in new_names.items():
        if old not in tables:
            continue
        if new in tables:
            raise ConfigError(
                f"[{section}{old}] and [{section}{new}] are the same table; must stand once: "
                f"keep [{section}{new}]"
            )
        tables[new] = tables.pop(old)
        warnings.warn(
            f"[{section}{old}] is now called [{section}{new}]; rename it in the file",
            RenamedKey,
            stacklevel=2,
        )


def rename_key(assignment: str, new_names: dict[str, str], section: str) -> str:
    """Give `section.old.key=value` its new name, with a RenamedKey warning; any other as it is."""
    for old, new in new_names.items():
        if assignment.startswith(f"{section}{old}."):
            text = f"[{section}{old}] is now called [{section}{new}]; rename it in the command"
            warnings.warn(text, RenamedKey, stacklevel=2)
            return assignment.replace(old, new, 1)
    return assignment


def nearest(word: str, known: Any) -> str:
    """Return ', did you mean ...?' for the nearest known word, empty when none is near."""
    close = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean '{close[0]}'?" if close else ""


def read_text(path: Path, what: str) -> str:
    """Read the text of a file; raises ConfigError when it cannot be read."""
    try:
        return path.read_text(errors="replace")
    except OSError as error:
        raise ConfigError(
            f"{what} '{path}' cannot be read: {error.strerror}; check the file and its permissions"
        ) from None


def read_toml(path: Path, what: str, next_step: str = "correct that line") -> dict[str, Any]:
    """Read the tables of a file; raises ConfigError when it cannot be read or is not TOML."""
    try:
        tables = tomllib.loads(read_text(path, what))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{what} '{path}' is not valid TOML: {error}; {next_step}") from None
    except RecursionError:
        raise _too_deep(f"{what} '{path}'") from None
    if not _is_shallow(tables):
        raise _too_deep(f"{what} '{path}'")
    return tables


def format_value(value: object) -> str:
    """Format text, a number, or a list of them as the value of a key."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # a JSON string is a TOML string
    if isinstance(value, list | tuple):
        return "[" + ", ".join(format_value(one) for one in value) + "]"
    return str(value)


def _is_shallow(tables: Any) -> bool:
    """Tell whether tables and lists lie at most MAX_DEPTH deep in each other."""
    level = [tables]
    for _ in range(MAX_DEPTH):
        inner: list[Any] = []
        for table in level:
            members = table.values() if isinstance(table, dict) else table
            inner.extend(member for member in members if isinstance(member, dict | list))
        if not inner:
            return True
        level = inner
    return False


def _too_deep(what: str) -> ConfigError:
    return ConfigError(
        f"{what} has tables or lists within each other; must be <= {MAX_DEPTH} deep: "
        "write [section] and key = value"
    )


def override(tables: dict[str, Any], text: str) -> None:
    """Put `section.key=value` into the tables of a file.

    A number is an index of a list. A key outside all sections must stand in the file. Raises
    ConfigError for a text of another form.
    """
    path, equals, value = text.partition("=")
    keys = path.strip().split(".")
    is_section = len(keys) < 2 and isinstance(tables.get(keys[0], {}), dict)
    if not equals or not all(keys) or is_section:
        raise ConfigError(
            f"--set '{text}': must be section.key=value, for example --set move.distance_m=0.1"
        )
    new_value = _value(value.strip())
    if len(keys) > MAX_DEPTH or not _is_shallow([new_value]):
        raise _too_deep(f"--set {keys[0]}...")
    table: Any = tables
    for key in keys[:-1]:
        table = _descend(table, key, text)
    if isinstance(table, list):
        _descend(table, keys[-1], text)
        table[int(keys[-1])] = new_value
    else:
        table[keys[-1]] = new_value


def _descend(table: Any, key: str, text: str) -> Any:
    """Look up the table or list below key; create the table where there is none."""
    if isinstance(table, list):
        if not (key.isdigit() and int(key) < len(table)):
            raise ConfigError(
                f"--set '{text}': '{key}' of a list of {len(table)}; must be 0 to {len(table) - 1}"
            )
        return table[int(key)]
    inner = table.setdefault(key, {})
    if not isinstance(inner, dict | list):
        raise ConfigError(f"--set '{text}': '{key}' is a value, not a section")
    return inner


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text  # a bare word is a string
    except RecursionError:
        raise _too_deep("--set") from None


def _explain(message: str, data: Any, kind: type, section: str) -> str:
    """Reword an error of msgspec in terms of the file."""
    what, _, place = message.partition(" - at `$")
    section_keys = section.split(".") if section else []
    inner = [key for key in re.split(r"[.\[\]]+", place.rstrip("`")) if key]
    keys = [*section_keys, *inner]
    unknown = re.search(r"unknown field `(.+)`", what)
    missing = re.search(r"missing required field `(.+)`", what)
    if unknown:
        struct = _type_at(kind, inner, data)
        known = [field.encode_name for field in msgspec.structs.fields(struct)]
        hint = nearest(unknown[1], known)
        return (
            f"[{'.'.join(keys)}] {unknown[1]}: unknown key{hint}; known keys: {', '.join(known)}"
        ).replace("[] ", "")
    if missing:
        return f"[{'.'.join(keys)}] {missing[1]}: missing; add it".replace("[] ", "section ")
    value = _value_at(data, inner)
    if isinstance(value, dict) and not what.startswith("Expected"):
        # error of a whole table, raised by the struct that it becomes
        return f"[{'.'.join(keys)}] {what}".removeprefix("[] ")
    if "enum" in what:
        allowed = get_args(_type_at(kind, inner, data))
        names = [one for one in allowed if isinstance(one, str)]  # others are numbers
        what = f"must be one of {', '.join(map(repr, allowed))}{nearest(str(value), names)}"
    if what.startswith("Invalid value") and (tags := _tags(_type_at(kind, inner[:-1], data))):
        what = f"must be one of {', '.join(tags)}{nearest(str(value), tags)}"
    where = f"[{'.'.join(keys[:-1])}] {keys[-1]}" if keys else "the file"
    problem = f"{what[0].lower()}{what[1:]}{_unit_hint(keys, value)}"
    return f"{where} = {value!r}: {problem}; correct the value".removeprefix("[] ")


def _unit_hint(keys: list[str], value: Any) -> str:
    """Word what a value would be in another unit, or without the unit that it carries."""
    key = keys[-1] if keys else ""
    if not isinstance(value, str):
        return other_unit(key, value)
    advice = without_unit(value, key_unit(key)) if key_unit(key) else ""
    return f"; it {advice}" if advice else ""


def _type_at(kind: Any, keys: list[str], data: Any) -> Any:
    """Find the type at a place; of a union of structs, the one that the data name by their tag."""
    for key in keys:
        kind = _member_type(kind, key)
        data = _value_at(data, [key])
        tag_field = next(iter(_tagged(kind)), None)
        if tag_field is not None and isinstance(data, dict):
            named = [part for part in get_args(kind) if _tag(part) == data.get(tag_field)]
            kind = named[0] if named else kind
    return kind


def _tagged(kind: Any) -> list[str]:
    """List the names of the tags of a union of structs; [] of another type."""
    parts = [part for part in get_args(kind) if _tag(part) is not None]
    return [part.__struct_config__.tag_field for part in parts]


def _tags(kind: Any) -> list[str]:
    """List the values of the tag of a union of structs."""
    return [str(_tag(part)) for part in get_args(kind) if _tag(part) is not None]


def _tag(kind: Any) -> Any:
    """Return the tag of a struct; None of another type."""
    is_struct = isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    return kind.__struct_config__.tag if is_struct else None


def _member_type(kind: Any, key: str) -> Any:
    """Find the type of a struct's field or of the elements of a container; X for `X | None`."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        field = next(field for field in msgspec.structs.fields(kind) if field.encode_name == key)
        kind = get_type_hints(kind)[field.name]
    else:
        kind = next(part for part in reversed(get_args(kind)) if part is not Ellipsis)
    parts = [part for part in get_args(kind) if part is not type(None)]
    return parts[0] if type(None) in get_args(kind) else kind


def _value_at(data: Any, keys: list[str]) -> Any:
    for key in keys:
        try:
            data = data[int(key)] if isinstance(data, list) else data[key]
        except (KeyError, ValueError, IndexError, TypeError):
            return data
    return data
