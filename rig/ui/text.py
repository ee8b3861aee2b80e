"""Text from files and other programs, made harmless for a terminal and for HTML."""

from __future__ import annotations

import html
import re

# C0 but tab and line feed, DEL, C1, and the marks that turn the direction of writing
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def without_controls(text: str) -> str:
    """Remove control characters, so that no text can steer the terminal."""
    return CONTROLS.sub("", text)


def escaped(value: object) -> str:
    """Write a value as HTML text: no markup, no control characters."""
    return html.escape(without_controls(str(value)), quote=True)
