"""Errors of the identification."""

from __future__ import annotations


class AnalysisError(Exception):
    """Data insufficient for the estimate: too few samples, too short a record, no swing."""


class RefusedError(AnalysisError):
    """A record that is no free decay, with the code of the reason beside its words."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text
