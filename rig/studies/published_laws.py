"""Coefficients of motion laws as source 000 prints them, and which of them are wrong."""

from __future__ import annotations

from typing import NamedTuple

from planners.laws.catalogue import Coefficients

FIGURES = ("cv", "ca", "cv_rms", "ca_rms")
LAST_DIGIT = 0.50001e-4  # rounding to the four printed digits


class Published(NamedTuple):
    """Figures of a law as source 000 prints them, in the order of FIGURES, and why some are wrong."""

    figures: tuple[float, float, float, float]
    reason: str = ""


# source 000, table of coefficients
PUBLISHED = {
    "triangular": Published((2.0, 4.0, 1.1547, 4.0)),
    "harmonic": Published(
        (1.5708, 4.9348, 1.1107, 3.4544),
        "below 2√3, the least of all moves: sampled, ends set to 0",
    ),
    "cycloidal": Published((2.0, 6.2832, 1.2247, 4.4428), "cut off, not rounded"),
    "cubic": Published(
        (1.5, 6.0, 1.0954, 3.4131), "below 2√3, the least of all moves and its own: sampled"
    ),
    "quintic": Published((1.875, 5.7733, 1.1952, 4.1402), "sampled beside the peak"),
    "septic": Published((2.1875, 7.5107, 1.2774, 5.0452), "sampled beside the peak"),
    "modified_trapezoidal": Published(
        (2.0, 4.8881, 1.2245, 4.3163), "2 % off; Ca rms / Ca must be √3/2"
    ),
    "modified_sine": Published(
        (1.7593, 5.5279, 1.1689, 3.9667), "Ca rms / Ca must be 1/√2; others in the last digits"
    ),
    "gutman_1_3": Published((2.0, 5.1296, 1.2006, 4.2475), "sampled beside the peak"),
    "freudenstein_1_3": Published((2.0, 5.3856, 1.2106, 4.3104), "in the last digits"),
    "freudenstein_1_3_5": Published(
        (2.0, 5.0603, 1.2028, 4.2516), "in the last digits; the exact factor is 1125/1192"
    ),
}


def wrong_figures(row: Coefficients) -> list[str]:
    """Names of the published figures that are more than their last digit off."""
    source = PUBLISHED.get(row.name)
    if source is None:
        return []
    return [
        key
        for key, figure in zip(FIGURES, source.figures, strict=True)
        if abs(figure - getattr(row, key)) > LAST_DIGIT
    ]
