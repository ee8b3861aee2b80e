"""docs/wire.md, made from the channel table and the layouts: `python -m comms.wire_page > docs/wire.md`."""

from __future__ import annotations

import sys

from comms.channels import CHANNELS, Channel
from comms.codec import CRC, HEADER, LAYOUTS, MAGIC, VERSION, Bound, Reject, bounds, length

HEAD = """# The wire

Made from `comms/channels.py` and `comms/codec.py` by `python -m comms.wire_page > docs/wire.md`; a test holds it to them.

One channel has one sender, one receiver and one row in the ledger: sent = delivered + lost + rejected.
SI units stand in the names; times are integer nanoseconds of the run clock (0 = the operator's start).

## Channels

"""

DATAGRAM = f"""
## Datagram

Little-endian. Header of {HEADER.size} bytes, payload, CRC-32 (IEEE) of {CRC.size} bytes over all that precedes it.

| field | type | meaning |
|---|---|---|
| magic | 2 bytes | `{MAGIC.decode()}` |
| version | u8 | {VERSION} |
| channel | u8 | id of the table above |
| length | u16 | bytes of the whole datagram |
| flags | u8 | 1 = closing: no payload, `seq` is the number of datagrams put on the wire |
| - | u8 | 0 |
| session | u64 | random for each run; another one is refused |
| seq | u32 | the sender's count, from 0 |
| t_ns | i64 | the sender's stamp |

A value that may be absent travels as NaN. Any other NaN, every infinity and every value out of bounds is refused.
Refusals are counted under their reason and change nothing: {", ".join(f"`{r.value}`" for r in Reject)}, then `old`
(an earlier sequence number than one already taken). Copies are counted as duplicated.

A frame travels over ZeroMQ push/pull as two parts: the datagram, then height x width (x 3 for `bgr8`) bytes of pixels.
Commands and replies are JSON over ZeroMQ; their fields are in `comms/messages.py`.

## Payloads

"""
TYPES = {"q": "i64", "d": "f64", "B": "u8", "H": "u16", "?": "bool", "s": "text"}


def page() -> str:
    """The whole page as Markdown."""
    rows = [
        "| id | channel | message | from | to | transport | Hz | late after | |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    rows += [_row(name, c) for name, c in CHANNELS.items()]
    payloads = [_payload(name, c) for name, c in CHANNELS.items() if c.message in LAYOUTS]
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


def _payload(name: str, c: Channel) -> str:
    about = (c.message.__doc__ or "").splitlines()[0]
    lines = [
        f"### {name}: {c.message.__name__}, {length(name)} bytes",
        "",
        about,
        "",
        "| field | type | bounds |",
        "|---|---|---|",
    ]
    for bound, kind in zip(
        _grouped(bounds(c.message)), _kinds(LAYOUTS[c.message].format), strict=True
    ):
        count = f" x {kind[1]}" if kind[1] > 1 else ""
        lines.append(f"| {bound.name} | {TYPES[kind[0]]}{count} | {_limits(bound, kind[0])} |")
    return "\n".join(lines) + "\n"


def _limits(bound: Bound, kind: str) -> str:
    if kind in "?s":
        return ""
    absent = ", or absent" if bound.optional else ""
    finite = abs(bound.low) < 1e300
    return (f"{bound.low:g} to {bound.high:g}" if finite else "finite") + absent


def _grouped(found: tuple[Bound, ...]) -> list[Bound]:
    """One bound a field: a position has three alike."""
    return [b for i, b in enumerate(found) if i == 0 or found[i - 1].name != b.name]


def _kinds(layout: str) -> list[tuple[str, int]]:
    """(type, count) of each field of a struct format; letters without a number are single fields."""
    kinds, number = [], ""
    for letter in layout:
        if letter.isdigit():
            number += letter
            continue
        kinds.append((letter, 1 if letter == "s" else int(number or 1)))
        number = ""
    return kinds


if __name__ == "__main__":
    sys.stdout.write(page())
