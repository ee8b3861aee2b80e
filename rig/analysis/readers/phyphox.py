"""Tables of phyphox: an archive of CSV files, or an experiment with its data (.phyphox)."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rig.analysis.readers.errors import UnreadableData, list_names
from rig.analysis.readers.signal_record import FloatArray, ReadOptions
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.analysis.readers.text_file import text_table
from rig.errors import ConfigError

TABLE_ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".lvm")
META_FOLDER = "meta/"  # of a phyphox export: facts of the device
MAX_MEMBER_BYTES = 1 << 30
HEAD = 1 << 16
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError)


def read_archive(path: Path, options: ReadOptions) -> SignalTable:
    """Read the table in a .zip; raises UnreadableData and ConfigError naming the files in it."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = [info.filename for info in archive.infolist() if not info.is_dir()]
            name = _member(path, members, options)
            if archive.getinfo(name).file_size > MAX_MEMBER_BYTES:
                raise UnreadableData(
                    f"{path}: '{name}' is larger than 1 GiB; must be unpacked first: unzip {path}"
                )
            data = archive.read(name)
    except DAMAGE as error:
        raise UnreadableData(
            f"{path}: archive that cannot be read ({error}): damaged or protected, export it again"
        ) from error
    where = f"{path}, file '{name}'"
    if name.endswith(".phyphox"):
        return _experiment(where, data)
    kind = f"archive, file '{name}'"
    return text_table(where, io.BytesIO(data), data[:HEAD], kind)


def _member(path: Path, members: Sequence[str], options: ReadOptions) -> str:
    """Choose the file of an archive."""
    tables = [
        name
        for name in members
        if name.lower().endswith((*TABLE_ENDINGS, ".phyphox"))
        and not name.startswith((META_FOLDER, "__MACOSX/"))
    ]
    if options.topic:
        chosen = [name for name in members if options.topic in (name, Path(name).stem)]
        if not chosen:
            raise ConfigError(
                f"{path}: --topic {options.topic}: no such file in the archive; files found: "
                f"{list_names(members)}"
            )
        return chosen[0]
    if len(tables) == 1:
        return tables[0]
    if not tables:
        raise UnreadableData(
            f"{path}: archive without a table; files found: {list_names(members) or 'none'}: "
            "must hold a .csv, .txt or .phyphox file"
        )
    raise UnreadableData(
        f"{path}: archive with {len(tables)} tables: {list_names(tables)}: "
        f"try --topic '{tables[0]}'"
    )


def read_experiment(path: Path, options: ReadOptions) -> SignalTable:
    """Read a .phyphox experiment saved with its data; raises UnreadableData."""
    return _experiment(str(path), path.read_bytes())


def _experiment(where: str, data: bytes) -> SignalTable:
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise UnreadableData(
            f"{where}: phyphox experiment that cannot be read ({error}): damaged, save it again"
        ) from error
    buffers = _buffers(root)
    columns = _exported(root, buffers)
    if not columns:
        filled = [SignalColumn(name, values) for name, values in buffers.items()]
        columns = _of_one_length(filled)
    if not columns:
        raise UnreadableData(
            f"{where}: phyphox experiment without data; buffers found: "
            f"{list_names(list(buffers)) or 'none'}: in phyphox take 'Save experiment state' after "
            "the recording, or 'Export data' as CSV"
        )
    return SignalTable(kind="phyphox experiment", columns=columns)


def _local(tag: str) -> str:
    return tag.rpartition("}")[2]


def _buffers(root: ElementTree.Element) -> dict[str, FloatArray]:
    """Collect the buffers that hold samples, by name."""
    buffers = {}
    for element in root.iter():
        if _local(element.tag) != "container":
            continue
        words = element.get("init", "").split(",")
        values = _floats(words)
        if values is not None and values.size > 1:
            buffers[(element.text or "").strip()] = values
    return buffers


def _floats(words: Sequence[str]) -> FloatArray | None:
    try:
        return np.array([float(word) for word in words], dtype=np.float64)
    except ValueError:
        return None


def _exported(root: ElementTree.Element, buffers: dict[str, FloatArray]) -> Sequence[SignalColumn]:
    """Collect the buffers of the export sets under their headers, which have units."""
    columns = []
    for element in root.iter():
        name = (element.text or "").strip()
        if _local(element.tag) == "data" and element.get("name") and name in buffers:
            columns.append(SignalColumn(str(element.get("name")), buffers[name]))
    return _of_one_length(columns)


def _of_one_length(columns: Sequence[SignalColumn]) -> Sequence[SignalColumn]:
    """Keep the columns of the length that most of them have; equal headers once."""
    lengths = [column.values.size for column in columns]
    if not lengths:
        return []
    usual = max(lengths, key=lambda length: (lengths.count(length), length))
    kept = {column.name: column for column in columns if column.values.size == usual}
    return list(kept.values())
