"""Coefficients of motion laws as source 000 prints them, and the wrong ones among them."""

from __future__ import annotations

from typing import NamedTuple

from planners.laws.catalogue import Coefficients

FIGURES = ("cv", "ca", "cv_rms", "ca_rms")
LAST_DIGIT_ROUNDING = 0.50001e-4  # of figures with four decimals


class PublishedCoefficients(NamedTuple):
    """Printed coefficients of a law in the order of FIGURES, and the reason of wrong ones."""

    figures: tuple[float, float, float, float]
    reason: str = ""


# source 000, table of coefficients
PUBLISHED = {
    "triangular": PublishedCoefficients((2.0, 4.0, 1.1547, 4.0)),
    "harmonic": PublishedCoefficients(
        (1.5708, 4.9348, 1.1107, 3.4544),
        "below 2√3, the least of all moves: sampled, ends set to 0",
    ),
    "cycloidal": PublishedCoefficients((2.0, 6.2832, 1.2247, 4.4428), "cut off, not rounded"),
    "cubic": PublishedCoefficients(
        (1.5, 6.0, 1.0954, 3.4131), "below 2√3, the least of all moves and its own: sampled"
    ),
    "quintic": PublishedCoefficients((1.875, 5.7733, 1.1952, 4.1402), "sampled beside the peak"),
    "septic": PublishedCoefficients((2.1875, 7.5107, 1.2774, 5.0452), "sampled beside the peak"),
    "modified_trapezoidal": PublishedCoefficients(
        (2.0, 4.8881, 1.2245, 4.3163), "2 % off; Ca rms / Ca must be √3/2"
    ),
    "modified_sine": PublishedCoefficients(
        (1.7593, 5.5279, 1.1689, 3.9667), "Ca rms / Ca must be 1/√2; others in the last digits"
    ),
    "gutman_1_3": PublishedCoefficients((2.0, 5.1296, 1.2006, 4.2475), "sampled beside the peak"),
    "freudenstein_1_3": PublishedCoefficients((2.0, 5.3856, 1.2106, 4.3104), "in the last digits"),
    "freudenstein_1_3_5": PublishedCoefficients(
        (2.0, 5.0603, 1.2028, 4.2516), "in the last digits; the exact factor is 1125/1192"
    ),
}


def wrong_figures(row: Coefficients) -> list[str]:
    """List the published figures that are wrong by more than the rounding of their last digit."""
    source = PUBLISHED.get(row.name)
    if source is None:
        return []
    return [
        key
        for key, figure in zip(FIGURES, source.figures, strict=True)
        if abs(figure - getattr(row, key)) > LAST_DIGIT_ROUNDING
    ]
