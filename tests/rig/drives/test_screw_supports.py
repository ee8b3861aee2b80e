"""Supports of a screw against a beam of finite elements and its characteristic equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from rig.drives.screw.supports import SUPPORTS

FREE, SIMPLE, MIXED, FIXED = (
    "fixed-free",
    "supported-supported",
    "fixed-supported",
    "fixed-fixed",
)  # ever stiffer


def beam(support, elements=120):
    """Build stiffness, mass and geometric matrices of a Hermite beam with E I = rho A = L = P = 1.

    The last result marks the deflections among its coordinates.
    """
    n, h = 2 * (elements + 1), 1.0 / elements
    k, m, g = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    stiff = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    stiff = np.vstack([stiff, -stiff[0], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) / h**3
    mass = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h * h, 13 * h, -3 * h * h],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
        ]
    )
    slope = np.array(
        [
            [36, 3 * h, -36, 3 * h],
            [3 * h, 4 * h * h, -3 * h, -h * h],
            [-36, -3 * h, 36, -3 * h],
            [3 * h, -h * h, -3 * h, 4 * h * h],
        ]
    )
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        k[at, at] += stiff
        m[at, at] += mass * h / 420.0
        g[at, at] += slope / (30.0 * h)
    held = {"fixed": (0, 1), "supported": (0,), "free": ()}
    first, second = support.split("-")
    out = {*held[first], *(n - 2 + i for i in held[second])}
    keep = [i for i in range(n) if i not in out]
    down = np.array([i % 2 == 0 for i in keep])
    pick = np.ix_(keep, keep)
    return k[pick], m[pick], g[pick], down


@pytest.mark.parametrize("name", SUPPORTS)
def test_the_coefficients_of_a_support_are_those_of_a_beam_of_finite_elements(name):
    k, m, g, down = beam(name)
    support = SUPPORTS[name]
    assert math.sqrt(eigh(k, m, eigvals_only=True)[0]) == pytest.approx(support.whirl, rel=1e-6)
    assert eigh(k, g, eigvals_only=True)[0] / math.pi**2 == pytest.approx(
        support.buckling, rel=1e-6
    )
    own = np.linalg.solve(k, _uniform(name))
    assert 1.0 / np.abs(own[down]).max() == pytest.approx(support.own_sag, rel=1e-4)
    bent = np.linalg.inv(k)[np.ix_(down, down)]  # a column for each place of a unit load
    assert 1.0 / np.abs(bent).max() == pytest.approx(
        support.load_sag, rel=3e-4
    )  # places are 1/120 apart


def _uniform(name, elements=120):
    """Compute the forces and moments of the free nodes under a load of 1 per length."""
    n, h = 2 * (elements + 1), 1.0 / elements
    f = np.zeros(n)
    for e in range(elements):
        f[2 * e : 2 * e + 4] += np.array([h / 2, h * h / 12, h / 2, -h * h / 12])
    held = {"fixed": (0, 1), "supported": (0,), "free": ()}
    first, second = name.split("-")
    out = {*held[first], *(n - 2 + i for i in held[second])}
    return f[[i for i in range(n) if i not in out]]


@pytest.mark.parametrize(
    ("name", "equation", "near"),
    [
        (FREE, lambda x: math.cos(x) * math.cosh(x) + 1.0, (1.5, 2.5)),
        (SIMPLE, math.sin, (3.0, 3.3)),
        (MIXED, lambda x: math.tan(x) - math.tanh(x), (3.5, 4.5)),
        (FIXED, lambda x: math.cos(x) * math.cosh(x) - 1.0, (4.5, 5.0)),
    ],
)
def test_the_whirl_coefficient_is_the_square_of_the_first_root(name, equation, near):
    assert SUPPORTS[name].whirl == pytest.approx(
        brentq(equation, *near, xtol=1e-14) ** 2, rel=1e-12
    )


def test_the_buckling_coefficient_of_one_fixed_end_is_that_of_tan_x_is_x():
    root = brentq(lambda x: math.tan(x) - x, 4.4, 4.6, xtol=1e-14)
    assert SUPPORTS[MIXED].buckling == pytest.approx((root / math.pi) ** 2, rel=1e-12)
