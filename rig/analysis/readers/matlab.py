"""Table of a MATLAB file: the vectors and matrices of one length."""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatReadError, MatReadWarning, matfile_version

from rig.analysis.readers.errors import UnreadableData, list_names, missing_extra
from rig.analysis.readers.matlab_tags import check_tags
from rig.analysis.readers.signal_record import FloatArray, ReadOptions
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.analysis.readers.units import split_header

KIND = "MATLAB file"
KIND_HDF5 = "MATLAB file v7.3"
VERSION_5 = 1  # as scipy numbers it
MAX_COLUMNS = 64  # of a matrix: a wider one is no set of signals
RATE_NAMES = {"fs", "rate", "rate_hz", "samplerate", "sample_rate", "samplingrate", "fsample"}
PERIOD_NAMES = {"dt", "ts", "deltat", "samplingtime", "sampletime", "sample_time"}
DAMAGE = (
    MatReadError,
    Warning,
    ValueError,
    TypeError,
    LookupError,
    OSError,
    RuntimeError,
    ArithmeticError,
    MemoryError,
    zlib.error,
)


def read_matlab(path: Path, options: ReadOptions) -> SignalTable:
    """Read a .mat file of version 4 to 7; raises UnreadableData."""
    try:
        major, _ = matfile_version(path)
        if major == VERSION_5:
            check_tags(path.read_bytes())
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", MatReadWarning)  # a name that is there twice
            variables = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except DAMAGE as error:
        raise UnreadableData(
            f"{path}: {KIND} that cannot be read ({_reason(error)}): damaged, save it again"
        ) from error
    arrays: dict[str, Any] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            arrays.update(_leaves(name, value))
    return _table(path, arrays, KIND, options)


def read_hdf5(path: Path, options: ReadOptions) -> SignalTable:
    """Read a .mat file of version 7.3, or another HDF5 file; raises UnreadableData."""
    try:
        import h5py
    except ImportError:
        raise missing_extra(path, KIND_HDF5, "h5py") from None
    arrays: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        is_text = item.attrs.get("MATLAB_class") in ("char", b"char")
        if isinstance(item, h5py.Dataset) and not name.startswith("#") and not is_text:
            arrays[name.replace("/", ".")] = np.squeeze(np.asarray(item[()]))

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
    except DAMAGE as error:
        raise UnreadableData(
            f"{path}: {KIND_HDF5} that cannot be read ({_reason(error)}): damaged, save it again"
        ) from error
    return _table(path, arrays, KIND_HDF5, options)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Walk through the fields of structures to the arrays in them."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        for field in fields:
            yield from _leaves(f"{name}.{field}", getattr(value, field))
        return
    yield name, np.asarray(value)


def _table(path: Path, arrays: Mapping[str, Any], kind: str, options: ReadOptions) -> SignalTable:
    """Put the vectors of one length side by side."""
    vectors = {}
    for name, array in arrays.items():
        vectors.update(_vectors(name, array))
    if not vectors:
        found = [f"{name} {np.shape(array)}" for name, array in arrays.items()]
        raise UnreadableData(
            f"{path}: {kind} without a vector of numbers; variables found: "
            f"{list_names(found) or 'none'}: save time and signal as vectors, "
            "or as a structure without objects"
        )
    length = _length(vectors, options)
    columns = []
    for name, vector in vectors.items():
        if vector.size == length:
            columns.append(SignalColumn(name, vector))
    rate_hz, source = _rate(arrays)
    return SignalTable(kind=kind, columns=columns, rate_hz=rate_hz, rate_source=source)


def _vectors(name: str, array: Any) -> dict[str, FloatArray]:
    """Split a variable into vectors; {} for what holds no numbers."""
    is_number = array.dtype.kind in "fiub" and array.size > 1
    if not is_number or array.ndim > 2:
        return {}
    if array.ndim == 1:
        return {name: array.astype(np.float64)}
    along = array if array.shape[0] >= array.shape[1] else array.T
    if along.shape[1] > MAX_COLUMNS:
        return {}
    columns = {}
    for index in range(along.shape[1]):
        columns[f"{name}(:,{index + 1})"] = along[:, index].astype(np.float64)
    return columns


def _length(vectors: Mapping[str, FloatArray], options: ReadOptions) -> int:
    """Choose the length: that of the wanted vector, else of those with most numbers."""
    wanted = options.signal or options.field
    if wanted in vectors:
        return vectors[wanted].size
    totals: dict[int, int] = {}
    for vector in vectors.values():
        totals[vector.size] = totals.get(vector.size, 0) + vector.size
    return max(totals, key=lambda length: totals[length])


def _rate(arrays: Mapping[str, Any]) -> tuple[float | None, str]:
    """Find a number that is named as sampling rate or period."""
    for name, array in arrays.items():
        bare = name.rpartition(".")[2].lower()
        is_number = np.size(array) == 1 and array.dtype.kind in "fiu"
        if not is_number or float(array) <= 0:
            continue
        if bare in RATE_NAMES or split_header(bare).name in RATE_NAMES:
            return float(array), f"variable '{name}'"
        if bare in PERIOD_NAMES:
            return 1 / float(array), f"variable '{name}'"
    return None, ""


def _reason(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
