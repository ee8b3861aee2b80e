"""Check of the tags in a MATLAB file of version 5, which scipy takes on trust.

A wrong tag ends the process in scipy.io.loadmat. Layout: MAT-File Format, MathWorks, chapter 1:
header of 128 bytes, then elements of tag (type, bytes) and data, padded to 8 bytes; a matrix
holds its flags, dimensions, name and data as elements. Compressed ones have a checksum.
"""

from __future__ import annotations

import struct

HEADER_BYTES = 128
TAG_BYTES = 8
ORDERS = {b"IM": "<", b"MI": ">"}
MATRIX = 14
COMPRESSED = 15
NUMBERS = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13}
TEXTS = {1, 2, 3, 4, 16, 17, 18}
BEGINNING = [6, 5, 1]  # types of flags, dimensions and name
CONTAINERS = {1: [], 2: [5, 1], 3: [1, 5, 1]}  # cell, structure, object: before their matrices
TEXT_CLASS, SPARSE_CLASS = 4, 5
NUMBER_CLASSES = range(6, 16)
CLASSES = range(1, 19)
COMPLEX = 0x0800  # in the flags
MAX_DEPTH = 32


def check_tags(data: bytes) -> None:
    """Raise ValueError at the first tag that does not fit."""
    mark = data[126:HEADER_BYTES]
    if mark not in ORDERS:
        raise ValueError(f"header with the byte order {mark!r}")
    _element_types(data, HEADER_BYTES, len(data), ORDERS[mark], 0)


def _element_types(data: bytes, start: int, end: int, order: str, depth: int) -> list[int]:
    """Check the elements from start to end; return their types."""
    if depth > MAX_DEPTH:
        raise ValueError("variables nested too deep")
    types = []
    place = start
    while place + TAG_BYTES <= end:
        kind, size = struct.unpack_from(f"{order}II", data, place)
        is_small = kind >> 16 != 0  # type, bytes and data in 8 bytes
        first = place + TAG_BYTES
        if is_small:
            kind, size = kind & 0xFFFF, kind >> 16
            first = place + TAG_BYTES // 2
        room = TAG_BYTES // 2 if is_small else end - first
        if size > room:
            raise ValueError(f"element of {size} bytes at byte {place}, where {room} are left")
        if kind == MATRIX and size:
            _check_matrix(data, first, first + size, order, depth + 1)
        elif kind not in NUMBERS | TEXTS | {MATRIX, COMPRESSED}:
            raise ValueError(f"element of unknown type {kind} at byte {place}")
        types.append(kind)
        is_padded = kind != COMPRESSED and not is_small
        padding = -size % TAG_BYTES if is_padded else 0
        place = place + TAG_BYTES if is_small else first + size + padding
    return types


def _check_matrix(data: bytes, start: int, end: int, order: str, depth: int) -> None:
    """Check that the elements of a matrix are those of its class."""
    types = _element_types(data, start, end, order, depth)
    if types[:3] != BEGINNING or len(types) < 3:
        raise ValueError(f"variable without flags, dimensions and name at byte {start}")
    (flags,) = struct.unpack_from(f"{order}I", data, start + TAG_BYTES)
    parts = 2 if flags & COMPLEX else 1
    array_class = flags & 0xFF
    if array_class not in CLASSES:
        raise ValueError(f"variable of unknown class {array_class} at byte {start}")
    values = types[3:]
    is_good = True
    if array_class in CONTAINERS:
        fields = CONTAINERS[array_class]
        is_good = values[: len(fields)] == fields and set(values[len(fields) :]) <= {MATRIX}
    elif array_class in NUMBER_CLASSES:
        is_good = len(values) == parts and set(values) <= NUMBERS
    elif array_class == SPARSE_CLASS:
        is_good = len(values) == 2 + parts and set(values) <= NUMBERS
    elif array_class == TEXT_CLASS:
        is_good = len(values) == 1 and set(values) <= TEXTS
    if not is_good:
        raise ValueError(f"variable of class {array_class} with other data at byte {start}")
