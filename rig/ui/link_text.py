"""Description of the faults of a link."""

from __future__ import annotations

from comms.link import LinkFaults


def link_faults(f: LinkFaults) -> str:
    """Describe delay, jitter, loss and corruption of a link."""
    words = []
    if f.delay_ms:
        words.append(f"{f.delay_ms:g} ms")
    if f.jitter_ms:
        words.append(f"+ up to {f.jitter_ms:g} ms")
    if f.loss:
        words.append(f"{f.loss:.0%} lost in bursts of {f.burst}")
    if f.corrupt:
        words.append(f"{f.corrupt:.0%} corrupted")
    return ", ".join(words) or "no faults"
