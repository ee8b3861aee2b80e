"""Experiment file with changed keys, written as TOML."""

from __future__ import annotations

from typing import Any

from rig.run import config
from rig.run.toml_file import format_value, override


def tuned_text(name: str, changes: list[str]) -> str:
    """Format the tables of an experiment with `section.key=value` changes."""
    tables = config.read_tables(name)
    for change in changes:
        override(tables, change)
    return "# Written by `rig tune`: the model is that of the load that was found.\n" + "\n".join(
        _lines(tables, "")
    )


def _lines(table: dict[str, Any], prefix: str) -> list[str]:
    values = {k: v for k, v in table.items() if not _is_table(v)}
    lines = [f"{key} = {_value(value)}" for key, value in values.items()]
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            inner = _lines(value, f"{name}.")
            has_own = not value or any(not _is_table(one) for one in value.values())
            lines += ["", f"[{name}]", *inner] if has_own else inner
        elif _is_table(value):
            for one in value:
                lines += ["", f"[[{name}]]", *_lines(one, f"{name}.")]
    return lines if prefix else [*lines, ""]


def _is_table(value: Any) -> bool:
    if isinstance(value, dict):
        return True
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return format_value(value)
