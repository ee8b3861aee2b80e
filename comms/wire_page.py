"""Generator of docs/wire.md, from the channel table and the payload layouts.

Usage: `python -m comms.wire_page > docs/wire.md`.
"""

from __future__ import annotations

import enum
import sys

from comms.channels import CHANNELS, Channel
from comms.codec import CRC, HEADER, MAGIC, VERSION, Reject, length, link_length
from comms.layouts import LAYOUTS, Bound, bounds, group_bounds
from comms.link import WINDOW_PACKETS
from comms.messages import InvalidReason, Message, Phase, Space, SwingPlane

HEAD = """# The wire

Generated from `comms/channels.py`, `comms/layouts.py` and `comms/codec.py` by
`python -m comms.wire_page > docs/wire.md`; a test compares them.

A channel has one sender, one receiver and one row in the ledger: sent = delivered + lost +
rejected. SI units stand in the names; times are integer nanoseconds of the run clock (0 = start by
the operator).

## Channels

"""

DATAGRAM = f"""
## Datagram

Little-endian. Header of {HEADER.size} bytes, payload, CRC-32 (IEEE) of {CRC.size} bytes over
header and payload.

| field | type | meaning |
|---|---|---|
| magic | 2 bytes | `{MAGIC.decode()}` |
| version | u8 | {VERSION} |
| channel | u8 | id of the table above |
| length | u16 | bytes of the whole datagram |
| flags | u8 | 1 = closing: no payload, `seq` is the number of datagrams sent |
| - | u8 | 0 |
| session | u64 | random number of the run; another one is rejected |
| seq | u32 | sequence number of the sender, from 0 |
| t_ns | i64 | time stamp of the sender |

An absent value is NaN. Any other NaN, every infinity and every value out of bounds is rejected.
Rejected datagrams are counted under their reason and change nothing else:
{", ".join(f"`{r.value}`" for r in Reject)}, then
`old` (the sequence number is {WINDOW_PACKETS} or more below the newest). A datagram that a newer
one overtook counts as delivered and superseded, and is not used. Copies count as duplicated, what
is not from the sender of the channel as foreign; both stand outside the sum.

A message with links has one group of values for each link, the link at the platform first, behind
its other values; their number follows from the length of the datagram. Values of joints are in m
or rad by `space`; those beyond `count` are 0, and those in metres have the bounds of a position and
of a velocity. An angle sample is `valid` if it has links. For camera k, the platform goes to its
vision task on `platform_k`, the pictures go on `frame_k`, the angles on `angle_k`. A run has
the channels between its tasks: those of cameras 2 and 3 with `vision_2` and `vision_3`, those of
the field bus with `drive`.

A frame is sent over ZeroMQ push/pull in two parts: the datagram, then height x width (x 3 for
`bgr8`) bytes of pixels. Commands and replies are JSON over ZeroMQ; their fields are in
`comms/messages.py`.

## Payloads

"""


def _codes(kind: type[enum.Enum]) -> str:
    return " (" + ", ".join(f"{code} = {item.value}" for code, item in enumerate(kind)) + ")"


CODES = {
    "space": _codes(Space),
    "swing_plane": _codes(SwingPlane),
    "phase": _codes(Phase),
    "reason": _codes(InvalidReason),
}
FIELDS = ("| field | type | bounds |", "|---|---|---|")
MAX_FLOAT = 1e300
TYPES = {"I": "u32", "q": "i64", "d": "f64", "B": "u8", "H": "u16", "?": "bool", "s": "text"}


def page() -> str:
    """Generate the page as Markdown."""
    rows = [
        "| id | channel | message | from | to | transport | Hz | late after | content |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    rows += [_row(name, c) for name, c in CHANNELS.items()]
    payloads = [_payload(message) for message in LAYOUTS]
    return HEAD + "\n".join(rows) + "\n" + DATAGRAM + "\n".join(payloads)


def _row(name: str, c: Channel) -> str:
    rate = f"{c.rate_hz:g}" if c.rate_hz else "-"
    cells = (
        c.id,
        name,
        c.message.__name__,
        c.sender,
        c.receiver,
        c.transport.value,
        rate,
        f"{c.late_after_ms:g} ms",
        c.about,
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def _payload(message: type[Message]) -> str:
    """Describe the payload of a message, which is that of all its channels."""
    about = (message.__doc__ or "").splitlines()[0]
    names = [name for name, c in CHANNELS.items() if c.message is message]
    size = f"{length(names[0])} bytes"
    layout = LAYOUTS[message]
    if layout.group:
        size += f" and {link_length(names[0])} bytes a link, at most {layout.group.most} links"
    lines = [f"### {message.__name__}: {size}", "", f"{about} Channels: {', '.join(names)}.", ""]
    lines += [*FIELDS, *_rows(bounds(message), layout.format)]
    if layout.group:
        kind = layout.group.kind
        lines += ["", f"Each link: {(kind.__doc__ or '').splitlines()[0]}", ""]
        lines += [*FIELDS, *_rows(group_bounds(message), layout.group.format)]
    return "\n".join(lines) + "\n"


def _rows(found: tuple[Bound, ...], layout: str) -> list[str]:
    fields = _bounds_by_field(found)
    rows = []
    for bound, (letter, count) in zip(fields, _field_types(layout), strict=True):
        repeat = f" x {count}" if count > 1 else ""
        meaning = CODES.get(bound.name, "")
        rows.append(
            f"| {bound.name} | {TYPES[letter]}{repeat} | {_limits(bound, letter)}{meaning} |"
        )
    return rows


def _limits(bound: Bound, letter: str) -> str:
    if letter in "?s":
        return ""
    absent = ", or absent" if bound.optional else ""
    if letter in "BHIq" and abs(bound.high) < MAX_FLOAT:
        return f"{bound.low:.0f} to {bound.high:.0f}"
    if abs(bound.low) >= MAX_FLOAT:  # no bound declared
        return "finite" + absent
    return f"{bound.low:g} to {bound.high:g}" + absent


def _bounds_by_field(found: tuple[Bound, ...]) -> list[Bound]:
    """Reduce the bounds to one a field; the three values of a position have equal ones."""
    return [b for i, b in enumerate(found) if i == 0 or found[i - 1].name != b.name]


def _field_types(layout: str) -> list[tuple[str, int]]:
    """List (letter, count) of the fields of a struct format; without a number, the count is 1."""
    types = []
    number = ""
    for letter in layout:
        if letter.isdigit():
            number += letter
            continue
        types.append((letter, 1 if letter == "s" else int(number or 1)))
        number = ""
    return types


if __name__ == "__main__":
    sys.stdout.write(page())
