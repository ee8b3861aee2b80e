"""TOML files: tables in, structs out; an error names section, key, value, bound and the nearest known key."""

from __future__ import annotations

import difflib
import re
import tomllib
import warnings
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from rig.errors import ConfigError, RenamedKey

T = TypeVar("T")


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file: unknown keys are errors."""


def convert(data: Any, kind: type[T], section: str = "") -> T:
    """data as kind; raises ConfigError in terms of the experiment file."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(_explain(str(error), data, kind, section)) from None


def rename_keys(tables: dict[str, Any], new_names: dict[str, str]) -> None:
    """Move the tables of old names to their new names, with a RenamedKey warning for each.

    Raises ConfigError for a file that has a table under both names.
    """
    for old, new in new_names.items():
        if old not in tables:
            continue
        if new in tables:
            raise ConfigError(
                f"[{old}] and [{new}] are the same table; must stand once: keep [{new}]"
            )
        tables[new] = tables.pop(old)
        warnings.warn(
            f"[{old}] is now called [{new}]; rename it in the file", RenamedKey, stacklevel=2
        )


def nearest(word: str, known: Any) -> str:
    """', did you mean ...?' when something known is close."""
    close = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean '{close[0]}'?" if close else ""


def read_text(path: Path, what: str) -> str:
    """A file's text; raises ConfigError when it cannot be read."""
    try:
        return path.read_text(errors="replace")
    except OSError as error:
        raise ConfigError(
            f"{what} '{path}' cannot be read: {error.strerror}; check the file and its permissions"
        ) from None


def read_toml(path: Path, what: str, next_step: str = "mend that line") -> dict[str, Any]:
    """A file's tables; raises ConfigError when it cannot be read or is no TOML."""
    try:
        return tomllib.loads(read_text(path, what))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{what} '{path}' is not valid TOML: {error}; {next_step}") from None


def override(tables: dict[str, Any], text: str) -> None:
    """Put `section.key=value` into the tables of a file; a number is an index of a list, and a key above all sections is one
    that the file has. Raises ConfigError for a text that is no such thing.
    """
    path, equals, value = text.partition("=")
    keys = path.strip().split(".")
    if not equals or not all(keys) or (len(keys) < 2 and isinstance(tables.get(keys[0], {}), dict)):
        raise ConfigError(
            f"--set '{text}': must be section.key=value, for example --set move.distance_m=0.1"
        )
    table: Any = tables
    for key in keys[:-1]:
        table = _step(table, key, text)
    if isinstance(table, list):
        _step(table, keys[-1], text)
        table[int(keys[-1])] = _value(value.strip())
    else:
        table[keys[-1]] = _value(value.strip())


def _step(table: Any, key: str, text: str) -> Any:
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


def _explain(message: str, data: Any, kind: type, section: str) -> str:
    what, _, at = message.partition(" - at `$")
    keys = [k for k in re.split(r"[.\[\]]+", at.rstrip("`")) if k]
    if section:
        keys = [*section.split("."), *keys]
    unknown = re.search(r"unknown field `(.+)`", what)
    missing = re.search(r"missing required field `(.+)`", what)
    if unknown:
        known = [f.encode_name for f in msgspec.structs.fields(_struct_at(kind, keys, section))]
        return (
            f"[{'.'.join(keys)}] {unknown[1]}: unknown key{nearest(unknown[1], known)}; known here: {', '.join(known)}"
        ).replace("[] ", "")
    if missing:
        return f"[{'.'.join(keys)}] {missing[1]}: missing; add it".replace("[] ", "section ")
    inner = keys[len(section.split(".")) if section else 0 :]
    value = _value_at(data, inner)
    if isinstance(value, dict) and not what.startswith("Expected"):
        return f"[{'.'.join(keys)}] {what}".removeprefix(
            "[] "
        )  # of a whole table, by the one who builds it
    if "enum" in what:
        allowed = get_args(_struct_at(kind, keys, section))
        what = f"must be one of {', '.join(map(repr, allowed))}{nearest(str(value), allowed)}"
    where = f"[{'.'.join(keys[:-1])}] {keys[-1]}" if keys else "the file"
    return f"{where} = {value!r}: {what[0].lower()}{what[1:]}; change it to fit".removeprefix("[] ")


def _struct_at(kind: Any, keys: list[str], section: str) -> Any:
    for key in keys[len(section.split(".")) if section else 0 :]:
        kind = _within(kind, key)
    return kind


def _within(kind: Any, key: str) -> Any:
    """The type of a struct's field, or of what a list, tuple or dict is made of; of `X | None` that is X."""
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
