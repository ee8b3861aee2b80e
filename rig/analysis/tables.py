"""Tables of a log: one for each topic, a row for each message, for spreadsheets and data frames."""

from __future__ import annotations

import base64
import csv
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from comms.errors import LogError
from comms.log_entry import Entry
from comms.mcap_log import Log

TIMES = ("log_time_ns", "publish_time_ns")
ROWS = "rows"  # field of a batch: `/receipts/...` carries many receipts in one message
RECEIPT = ("seq", "t_rx_ns", "outcome")
PICTURE_TYPES = {"jpeg": ".jpg", "png": ".png"}
MAX_LIST_COLUMNS = 16  # a longer list stays one cell, as JSON
Row = dict[str, Any]


def table_name(topic: str) -> str:
    """File name of a topic's table, without ending: `/link/angle_1` is link_angle_1."""
    return topic.strip("/").replace("/", "_") or "root"


def rows_of(entries: Iterable[Entry]) -> Iterator[Row]:
    """One row for each message, flat: fields of a table as a_b, items of a list as a_0, a_1
    (up to MAX_LIST_COLUMNS, else as JSON in one cell).

    A batch of receipts gives one row for each receipt. Raises LogError for a message that is no
    JSON object.
    """
    for entry in entries:
        stamps = {TIMES[0]: entry.log_ns, TIMES[1]: entry.publish_ns}
        try:
            fields = json.loads(entry.data)
        except ValueError as error:
            raise LogError(
                f"a message is no JSON ({error}); only JSON logs become tables"
            ) from None
        if not isinstance(fields, dict):
            raise LogError(f"a message is {type(fields).__name__}; must be a JSON object")
        if not isinstance(fields.get(ROWS), list):
            yield stamps | _flat(fields)
            continue
        batch = fields.pop(ROWS)
        for item in batch:
            receipt = dict(zip(RECEIPT, item, strict=False))
            yield stamps | _flat(fields) | receipt


def write_csv(log: Log, folder: Path) -> list[Path]:
    """Write <topic>.csv for each topic of a log, and its pictures as files; return the files."""
    written = []
    for topic, entries in sorted(log.topics.items()):
        rows = list(_without_pictures(entries, folder, topic))
        path = folder / f"{table_name(topic)}.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, _columns(rows))
            writer.writeheader()
            writer.writerows(rows)
        written.append(path)
    return written


def write_parquet(log: Log, folder: Path) -> list[Path]:
    """Write <topic>.parquet for each topic of a log, and its pictures as files; return the files.

    Raises LogError where pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise LogError(
            "--parquet needs pyarrow, which is not installed; "
            "install the extra: pip install 'swayless[parquet]', or take --csv"
        ) from None
    written = []
    for topic, entries in sorted(log.topics.items()):
        rows = list(_without_pictures(entries, folder, topic))
        names = _columns(rows)
        columns = {name: [row.get(name) for row in rows] for name in names}
        path = folder / f"{table_name(topic)}.parquet"
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
        written.append(path)
    return written


def _without_pictures(entries: list[Entry], folder: Path, topic: str) -> Iterator[Row]:
    """Rows with the picture data replaced by the name of the file that they are written to."""
    for k, row in enumerate(rows_of(entries)):
        data = row.get("data")
        ending = PICTURE_TYPES.get(str(row.get("format")))
        if isinstance(data, str) and ending:
            picture = folder / f"{table_name(topic)}_{k:05d}{ending}"
            picture.write_bytes(base64.b64decode(data))
            row = {**row, "data": picture.name}
        yield row


def _columns(rows: list[Row]) -> list[str]:
    """Names in the order of their first appearance."""
    names = dict.fromkeys(TIMES)
    for row in rows:
        names |= dict.fromkeys(row)
    return list(names)


def _flat(fields: dict[str, Any], prefix: str = "") -> Row:
    flat: Row = {}
    for name, value in fields.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{name}_")
        elif isinstance(value, list) and len(value) > MAX_LIST_COLUMNS:
            flat[prefix + name] = json.dumps(value)
        elif isinstance(value, list):
            numbered = {str(k): item for k, item in enumerate(value)}
            flat |= _flat(numbered, f"{prefix}{name}_")
        else:
            flat[prefix + name] = value
    return flat
