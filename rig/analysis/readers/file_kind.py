"""Kind of a file by its first bytes; files without a table are refused by name."""

from __future__ import annotations

import enum
import re
from pathlib import Path

from rig.analysis.readers.errors import UnreadableData

HEAD_BYTES = 1 << 16
MCAP_MAGIC = b"\x89MCAP0\r\n"
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
HDF5_OFFSET = 512  # of the HDF5 part of a MATLAB file
CANDUMP = re.compile(rb"^\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}#", re.M)
ASC_BASE = re.compile(rb"^base\s+(hex|dec)\b", re.M | re.I)
VIDEO = "a video; must be a table of numbers: follow the cable in it with `rig track`"
PICTURE = "a picture; must be a table of numbers"
REFUSED = (
    (0, b"\xff\xd8\xff", PICTURE),
    (0, b"\x89PNG\r\n", PICTURE),
    (0, b"GIF8", PICTURE),
    (0, b"BM", PICTURE),
    (0, b"II*\0", PICTURE),
    (0, b"MM\0*", PICTURE),
    (8, b"WEBP", PICTURE),
    (4, b"ftyp", VIDEO),
    (4, b"moov", VIDEO),
    (8, b"AVI ", VIDEO),
    (0, b"\x1aE\xdf\xa3", VIDEO),
    (0, b"\0\0\1\xba", VIDEO),
    (8, b"WAVE", "a sound file; must be a table of numbers: export it as text"),
    (0, b"%PDF", "a PDF document; must be a table of numbers: export the data as text"),
    (0, b"\x1f\x8b", "a packed file (gzip); must be unpacked first: gunzip FILE"),
    (0, b"7z\xbc\xaf", "a packed file (7z); must be unpacked first"),
    (0, b"Rar!", "a packed file (rar); must be unpacked first"),
    (0, b"#ROSBAG", "a ROS 1 bag; must be an MCAP file: mcap convert FILE.bag FILE.mcap"),
    (
        0,
        b"SQLite format 3",
        "an SQLite database; a ROS 2 bag must be an MCAP file: ros2 bag convert",
    ),
    (0, b"PAR1", "a Parquet file; must be text: export it as CSV"),
    (0, b"TDSm", "a TDMS file; must be text, .lvm or .mat: export it"),
    (0, b"MDF     ", "an MDF file; must be text or .mat: export it"),
    (0, b"\x93NUMPY", "a NumPy array; must be text: numpy.savetxt(FILE, array)"),
    (0, b"\x7fELF", "a program; must be a table of numbers"),
)
REFUSED_ENDINGS = {
    ".mp4": VIDEO,
    ".mov": VIDEO,
    ".avi": VIDEO,
    ".mkv": VIDEO,
    ".jpg": PICTURE,
    ".png": PICTURE,
}


class FileKind(enum.Enum):
    """Kinds of files that can be read."""

    TEXT = "text"
    MATLAB = "MATLAB file"
    HDF5 = "MATLAB file v7.3"
    XLSX = "Excel workbook (.xlsx)"
    XLS = "Excel workbook (.xls)"
    ZIP = "archive"
    PHYPHOX = "phyphox experiment"
    MCAP = "MCAP file"
    CAN_BLF = ".blf"
    CAN_ASC = ".asc"
    CAN_TRC = ".trc"
    CAN_CANDUMP = ".log"


MAGIC = (
    (MCAP_MAGIC, FileKind.MCAP),
    (HDF5_MAGIC, FileKind.HDF5),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", FileKind.XLS),
    (b"PK\x03\x04", FileKind.ZIP),
    (b"PK\x05\x06", FileKind.ZIP),
    (b"LOGG", FileKind.CAN_BLF),
    (b";$FILEVERSION", FileKind.CAN_TRC),
)


def read_head(path: Path) -> bytes:
    """Read the first bytes; raises UnreadableData for an empty or missing file."""
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
    except OSError as error:
        raise UnreadableData(
            f"{path}: {error.strerror}; name a file with a table, a log or a run folder"
        ) from error
    if not head.strip(b"\0 \t\r\n\xef\xbb\xbf"):
        size = path.stat().st_size
        raise UnreadableData(f"{path}: empty ({size} bytes); name a file with a table of numbers")
    return head


def file_kind(path: Path, head: bytes) -> FileKind:
    """Tell the kind of a file; raises UnreadableData, naming a file that holds no table."""
    for magic, kind in MAGIC:
        if head.startswith(magic):
            return FileKind.XLSX if _is_workbook(path, kind) else kind
    if head.startswith(b"MATLAB 5.0"):
        return FileKind.MATLAB
    if head.startswith(b"MATLAB 7.3") or head[HDF5_OFFSET:].startswith(HDF5_MAGIC):
        return FileKind.HDF5
    _refuse(path, head)
    return _text_kind(path, head)


def _is_workbook(path: Path, kind: FileKind) -> bool:
    return kind is FileKind.ZIP and path.suffix.lower() in (".xlsx", ".xlsm")


def _refuse(path: Path, head: bytes) -> None:
    for offset, magic, what in REFUSED:
        if head[offset:].startswith(magic) and not _is_plain(head):
            raise UnreadableData(f"{path}: {what}")
    what = REFUSED_ENDINGS.get(path.suffix.lower(), "")
    if what and not _is_plain(head):
        raise UnreadableData(f"{path}: {what}")


def _is_plain(head: bytes) -> bool:
    """Tell if bytes are text without control characters; "BM" may begin a word."""
    is_short_magic = head.startswith((b"BM", b"II", b"MM"))
    return is_short_magic and b"\0" not in head[:512]


def _text_kind(path: Path, head: bytes) -> FileKind:
    if path.suffix.lower() == ".mat" and b"\0" in head[:512]:
        return FileKind.MATLAB  # version 4 has no magic
    if head.lstrip().startswith(b"<phyphox") or b"<phyphox " in head[:2048]:
        return FileKind.PHYPHOX
    if ASC_BASE.search(head[:4096]):
        return FileKind.CAN_ASC
    if CANDUMP.search(head[:4096]):
        return FileKind.CAN_CANDUMP
    if path.suffix.lower() == ".trc" and head.startswith(b";"):
        return FileKind.CAN_TRC
    return FileKind.TEXT
