"""Error of the identification."""

from __future__ import annotations


class AnalysisError(Exception):
    """Data insufficient for the estimate: too few samples, too short a record, no swing."""
