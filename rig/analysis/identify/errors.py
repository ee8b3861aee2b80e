"""The one root of what rig/analysis raises."""

from __future__ import annotations


class AnalysisError(Exception):
    """The data cannot carry the answer asked for: too few samples, too short a watch, nothing swinging."""
