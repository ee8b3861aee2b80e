"""Smallest .xls workbook (BIFF8 in a compound file), written without a library."""

import struct

SECTOR = 512
FREE, END, FAT_SECTOR = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD


def record(code, data):
    """Make a record of BIFF."""
    return struct.pack("<HH", code, len(data)) + data


def workbook(name, rows):
    """Make the stream of a workbook with one sheet of texts and numbers."""
    bof = struct.pack("<HHHHII", 0x0600, 0x0005, 0x0DBB, 0x07CC, 0, 0x06)
    sheet_bof = struct.pack("<HHHHII", 0x0600, 0x0010, 0x0DBB, 0x07CC, 0, 0x06)
    title = struct.pack("<BB", len(name), 0) + name.encode("latin-1")
    start = len(record(0x0809, bof)) + 4 + 6 + len(title) + 4
    stream = record(0x0809, bof)
    stream += record(0x0085, struct.pack("<IBB", start, 0, 0) + title)
    stream += record(0x000A, b"")
    stream += record(0x0809, sheet_bof)
    for r, row in enumerate(rows):
        for c, value in enumerate(row):
            place = struct.pack("<HHH", r, c, 0)
            if isinstance(value, str):
                text = struct.pack("<HB", len(value), 0) + value.encode("latin-1")
                stream += record(0x0204, place + text)
            else:
                stream += record(0x0203, place + struct.pack("<d", value))
    return stream + record(0x000A, b"")


def entry(name, kind, child, start, size):
    """Make an entry of the directory of a compound file."""
    text = (name + "\0").encode("utf-16-le")
    links = struct.pack("<BBIII", kind, 1, FREE, FREE, child)
    return (
        text.ljust(64, b"\0")
        + struct.pack("<H", len(text) if name else 0)
        + links
        + bytes(36)
        + struct.pack("<II", start, size)
        + bytes(4)
    )


def write_xls(path, name, rows):
    """Write a workbook with one sheet; up to about 60 kB."""
    stream = workbook(name, rows)
    stream = stream.ljust(max(4096, -(-len(stream) // SECTOR) * SECTOR), b"\0")
    sectors = len(stream) // SECTOR
    chain = [*range(3, 2 + sectors), END]
    fat = [FAT_SECTOR, END, *chain]
    fat += [FREE] * (SECTOR // 4 - len(fat))
    directory = entry("Root Entry", 5, 1, END, 0) + entry("Workbook", 2, FREE, 2, len(stream))
    directory += 2 * entry("", 0, FREE, 0, 0)
    header = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(16)
    header += struct.pack("<HHHHH", 0x3E, 3, 0xFFFE, 9, 6) + bytes(10)
    header += struct.pack("<IIIIIIII", 1, 1, 0, 4096, END, 0, END, 0)
    header += struct.pack("<109I", 0, *[FREE] * 108)
    path.write_bytes(header + struct.pack("<128I", *fat) + directory + stream)
