"""Fuzzed datagrams and messages at every endpoint, in this process.

Usage: `python -m endurance.fuzz [--count N] [--short] [--seed S]`. What comes without the session
of the run must be refused, whatever it is; what comes with it must be refused or keep its bounds.
Ends with exit code 1 at an exception or at a foreign message that was taken.
"""

from __future__ import annotations

import argparse
import random
import struct
import sys
import time
import zlib
from collections import Counter
from collections.abc import Callable

from comms import bus_content, codec
from comms.channels import CHANNELS
from comms.ends import admit
from comms.layouts import LAYOUTS
from comms.link import LinkCount, SequenceWindow
from comms.messages import Message
from comms.stop_port import KEY_BYTES, StopPort

SESSION = 0x1234_5678_9ABC_DEF0
COUNT, SHORT_COUNT = 1_000_000, 20_000
RECEIPTS_KEPT = 10_000
Datagram = Callable[[random.Random], bytes]


def zeros(channel: str) -> bytes:
    """A datagram of zeros with a valid header; also one that is refused, e.g. with count = 0."""
    size = codec.length(channel) - codec.CLOSING_BYTES
    return sealed(channel, bytes(size), SESSION)


def sealed(channel: str, payload: bytes, session: int, seq: int = 0) -> bytes:
    """A datagram with a right header and checksum."""
    size = codec.CLOSING_BYTES + len(payload)
    head = (codec.MAGIC, codec.VERSION, CHANNELS[channel].id, size, 0, session, seq, 0)
    body = codec.HEADER.pack(*head) + payload
    return body + struct.pack("<I", zlib.crc32(body))


def noise(rng: random.Random) -> bytes:
    """Random bytes of any length."""
    return rng.randbytes(rng.randrange(0, 300))


def flipped(base: bytes) -> Datagram:
    """The base with up to four changed bytes, cut or lengthened."""

    def make(rng: random.Random) -> bytes:
        data = bytearray(base)
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] ^= rng.randrange(1, 256)
        if rng.random() < 0.2:
            del data[rng.randrange(len(data)) :]
        if rng.random() < 0.1:
            data += rng.randbytes(rng.randrange(1, 50))
        return bytes(data) if data != base else base[:-1]

    return make


def forged(channel: str, own: bool) -> Datagram:
    """A right header and checksum before a random payload; own: with the session of the run."""
    sizes = [codec.length(channel) - codec.CLOSING_BYTES]
    group = LAYOUTS[CHANNELS[channel].message].group
    if group:
        sizes += [sizes[0] + links * codec.link_length(channel) for links in range(1, 6)]

    def make(rng: random.Random) -> bytes:
        session = SESSION if own else SESSION ^ rng.randrange(1, 2**63)
        payload = bytearray(rng.randbytes(rng.choice(sizes)))
        if rng.random() < 0.5:  # small numbers, which may be in their bounds
            payload[:] = bytes(len(payload))
            payload[rng.randrange(len(payload))] = rng.randrange(256)
        return sealed(channel, bytes(payload), session, rng.randrange(2**32))

    return make


class DataEnd:
    """Receiving end of a data channel."""

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self.count = LinkCount()
        self._window = SequenceWindow()
        self._receipts: list[tuple[int, int, str]] = []

    def take(self, data: bytes) -> Message | None:
        """Decode and admit a datagram."""
        if len(self._receipts) > RECEIPTS_KEPT:
            self._receipts.clear()
        got = codec.decode(self.channel, data, SESSION)
        return admit(got, self._window, self.count, 0, 0, self._receipts)


def fuzz_channel(channel: str, count: int, rng: random.Random) -> Counter[str]:
    """Fuzz a data channel; returns outcomes, `taken` for foreign datagrams that were taken."""
    foreign = (noise, flipped(zeros(channel)), forged(channel, own=False))
    outcomes: Counter[str] = Counter()
    end = DataEnd(channel)
    for _ in range(count):
        outcomes["taken"] += end.take(rng.choice(foreign)(rng)) is not None
    if end.count.delivered or end.count.duplicated:
        outcomes["taken"] += 1
    own = forged(channel, own=True)
    for _ in range(count // 4):
        outcomes["own, in bounds"] += end.take(own(rng)) is not None
    outcomes["refused"] = sum(end.count.rejected.values())
    return outcomes


def fuzz_stop_port(count: int, rng: random.Random) -> Counter[str]:
    """Fuzz the comparison of the stop port."""
    key = rng.randbytes(KEY_BYTES)
    port = StopPort(0, key)
    stops = (flipped(key + b"stop"), flipped(key + b"estop"), noise)
    outcomes: Counter[str] = Counter()
    try:
        for _ in range(count):
            data = rng.choice(stops)(rng)
            known = data in (key + b"stop", key + b"estop")
            outcomes["taken"] += (port.request(data) is not None) != known
    finally:
        port.close()
    return outcomes


def fuzz_bus(count: int, rng: random.Random) -> Counter[str]:
    """Fuzz the decoding of control messages and of telemetry."""
    words = (b"hello", b"farewell", b"reply", b"Event", b"LinkRow", b"Receipts", b"TaskTiming", b"")
    texts = (
        b"{}",
        b"[]",
        b'{"seq":1,"t_ns":2,"id":3,"sender":"x","ok":true,"phase":"armed"}',
        b"9",
    )
    outcomes: Counter[str] = Counter()
    for _ in range(count):
        parts = [rng.choice(words)]
        for _ in range(rng.randrange(3)):
            text = rng.choice(texts)
            parts.append(flipped(text)(rng) if rng.random() < 0.8 else rng.randbytes(20))
        outcomes["understood"] += bus_content.decode_control(parts) is not None
        outcomes["telemetry"] += bus_content.decode_telemetry(parts, 2) is not None
    return outcomes


def main() -> int:
    """Fuzz every endpoint; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="datagrams an endpoint")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    count = SHORT_COUNT if chosen.short else chosen.count
    rng = random.Random(chosen.seed)
    trials: dict[str, Callable[[], Counter[str]]] = {}
    for channel, row in CHANNELS.items():
        if row.message in LAYOUTS:
            trials[channel] = lambda channel=channel: fuzz_channel(channel, count, rng)
    trials["stop port"] = lambda: fuzz_stop_port(count, rng)
    trials["bus"] = lambda: fuzz_bus(count, rng)
    failed = 0
    for name, trial in trials.items():
        began = time.perf_counter()
        outcomes = trial()
        failed += outcomes["taken"] > 0
        seconds = time.perf_counter() - began
        print(f"{name:12} {count} foreign, {dict(outcomes)}, {seconds:.1f} s", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
