"""Published findings of source 004 and the runs that test them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib import resources
from typing import Literal

import msgspec

from rig.errors import ConfigError

QuantityName = Literal[
    "residual_swing",
    "peak_swing",
    "acceleration",
    "speed",
    "reversal",
    "command_lag",
    "tracking_swing",
    "cable_length",
    "damping_ratio",
    "natural_frequency",
    "rise_time",
    "bandwidth",
    "fit_deviation",
    "frequency_1",  # of the slowest mode of several links
    "frequency_2",
]
Relation = Literal["lower", "higher", "much lower", "similar", "small", "above", "equal"]
PAIRED = ("lower", "higher", "much lower", "similar")  # relations between two runs
BOUNDED = ("above", "equal")  # relations to a number
MEASURED = "measured"  # basis
# quantities whose measured value comes from the camera
CAMERA_QUANTITIES = (
    "residual_swing",
    "peak_swing",
    "tracking_swing",
    "cable_length",
    "damping_ratio",
    "natural_frequency",
    "frequency_1",
    "frequency_2",
)


class SourceFinding(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Finding of source 004: a relation of one quantity between runs, or of runs to a number.

    bound and last_digit are in the SI unit of the quantity. Raises ValueError for a relation
    without what it compares with.
    """

    text: str  # in our words
    runs: tuple[str, ...]  # experiments, NAME or NAME:SEED
    quantity: QuantityName
    relation: Relation
    against: tuple[str, ...] = ()  # experiments
    bound: float | None = None
    last_digit: float = 0.0  # of a printed bound
    note: str = ""  # reason, shown where our figures do not agree
    assumption: str = ""  # of ours, where the source gives no figure; always shown

    def __post_init__(self) -> None:
        if (self.relation in PAIRED) != bool(self.against):
            raise ValueError(f"relation {self.relation!r} with against = {self.against}")
        if (self.relation in BOUNDED) != (self.bound is not None):
            raise ValueError(f"relation {self.relation!r} with bound = {self.bound}")


class SourceFigure(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Figure of source 004 with its findings."""

    number: str
    title: str
    findings: tuple[SourceFinding, ...]

    @property
    def experiments(self) -> tuple[str, ...]:
        """Experiments that the findings compare, NAME or NAME:SEED, each once."""
        names: dict[str, None] = {}
        for finding in self.findings:
            names.update(dict.fromkeys((*finding.runs, *finding.against)))
        return tuple(names)


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Whole file."""

    figures: tuple[SourceFigure, ...]


@lru_cache(maxsize=1)
def source_figures() -> tuple[SourceFigure, ...]:
    """Read the figures in the order of the source."""
    text = resources.files("rig.studies.source_004").joinpath("findings.toml").read_bytes()
    return msgspec.toml.decode(text, type=_File).figures


def choose(words: Sequence[str]) -> tuple[SourceFigure, ...]:
    """Choose figures by number, or by an experiment that they compare; all without words.

    Raises ConfigError for a word that is neither.
    """
    figures = source_figures()
    if not words:
        return figures
    for word in words:
        if not any(_is_named(figure, word) for figure in figures):
            numbers = ", ".join(figure.number for figure in figures)
            raise ConfigError(
                f"{word!r} is neither a figure nor an experiment of the study; must be one of "
                f"{numbers}, or an experiment of `rig run --list` that one of them compares"
            )
    return tuple(f for f in figures if any(_is_named(f, word) for word in words))


def experiments_of(figures: Iterable[SourceFigure]) -> tuple[str, ...]:
    """List the experiments of several figures, each once."""
    names: dict[str, None] = {}
    for figure in figures:
        names.update(dict.fromkeys(figure.experiments))
    return tuple(names)


def _is_named(figure: SourceFigure, word: str) -> bool:
    names = {experiment.partition(":")[0] for experiment in figure.experiments}
    return word == figure.number or word in names
