"""Modal form of the linear boundary value problem: each state a mode that the input drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.models.model import Model, Modes
from planners.trajectories.pieces import ComplexArray, FloatArray


class ModePairs(NamedTuple):
    """Sums of eigenvalues that the products of two impulse responses share in their integrals."""

    eigenvalues_1_s: ComplexArray  # (m, m) mu_i + conj mu_j of the m distinct eigenvalues
    first: NDArray[np.intp]  # (n, 1) index of the distinct eigenvalue of a row
    second: NDArray[np.intp]  # (n,) the same along columns
    powers: NDArray[np.intp]  # (n, n)


class ModalForm(NamedTuple):
    """Modal coordinates xi = left_eigenvectors x of the states x.

    xi' = mu xi + u at power 0, xi' = mu xi + xi[drivers] at power 1 (a Jordan chain), so that the
    response of xi to a unit impulse of u is s^power exp(mu s).
    """

    eigenvalues_1_s: ComplexArray  # (n,) mu, closed under conjugation
    powers: NDArray[np.intp]  # (n,) 0 or 1
    drivers: NDArray[np.intp]  # (n,) index of the power 0 with the same eigenvalue
    partners: NDArray[np.intp]  # (n,) index of the complex conjugate, or its own
    left_eigenvectors: ComplexArray  # (n, n), one a row
    eigenvectors: ComplexArray  # (n, n), one a column; inverse of left_eigenvectors
    a: ComplexArray  # (n, n): xi' = a xi + b u
    b: FloatArray  # (n,)
    pairs: ModePairs


class _ModeList:
    """Eigenvalues, powers and drivers of the modal coordinates, collected one by one."""

    def __init__(self) -> None:
        self.eigenvalues: list[complex] = []
        self.powers: list[int] = []
        self.drivers: list[int] = []

    def append(self, eigenvalue: complex, driver: int | None = None) -> int:
        """Add a mode of power 0, or of power 1 behind its driver; return its index."""
        index = len(self.eigenvalues)
        self.eigenvalues.append(eigenvalue)
        self.powers.append(0 if driver is None else 1)
        self.drivers.append(index if driver is None else driver)
        return index


def modal_form(
    model: Model, input: str, lag_s: float, modes: Modes, shifted: tuple[int, ...], n: int
) -> ModalForm:
    """Assemble the left eigenvectors of platform, modes, sensitivities and filter.

    n is the number of states without the sensitivities; every mode in `shifted` has two of them.
    With a filter, the coordinate of a mode q behind it is q (1 + mu lag) + lag a, so that its
    impulse response contains no part of the filter's.
    """
    jerk = input == "jerk"
    lag = lag_s if jerk else 0.0
    size = n + 2 * len(shifted)
    swing = slice(2, 2 + 2 * model.links_count)
    left = np.zeros((size, size), dtype=np.complex128)
    coordinates = _ModeList()
    platform = coordinates.append(0j)
    coordinates.append(0j, platform)
    left[0, 1] = left[1, 0] = 1.0
    left[1, 1] = lag
    scale = 1.0
    if jerk:
        left[0, n - 1] = lag
    if input == "force":
        e = model.equations
        scale = e.cart_mass_kg + e.load_mass_kg
        left[:2] *= scale
        left[0, swing.start + model.links_count : swing.stop] = e.coupling_kg_m
        left[1, swing.start : swing.start + model.links_count] = e.coupling_kg_m
    drivers = {}
    for k, eigenvalue in enumerate(modes.eigenvalues_1_s.tolist()):
        row = coordinates.append(eigenvalue)
        drivers[k] = row
        left[row, swing] = scale * (1.0 + eigenvalue * lag) * modes.left_eigenvectors[k]
        if jerk:
            left[row, n - 1] = lag
    for i, k in enumerate(shifted):
        z = n + 2 * i  # real and imaginary part of the sensitivity
        for mode, sign in ((k, 1j), (k + 1, -1j)):
            eigenvalue = complex(modes.eigenvalues_1_s[mode])
            row = coordinates.append(eigenvalue, drivers[mode])
            left[row, z] = scale * (1.0 + eigenvalue * lag)
            left[row, z + 1] = scale * (1.0 + eigenvalue * lag) * sign
            left[row, swing] = lag * modes.left_eigenvectors[mode]
    if jerk:
        row = coordinates.append(complex(-1.0 / lag))
        left[row, n - 1] = lag
    return _assemble(coordinates, left)


def _assemble(coordinates: _ModeList, left: ComplexArray) -> ModalForm:
    """Find conjugate partners, the matrices of xi' = a xi + b u, and the pairs of eigenvalues."""
    keys = list(zip(coordinates.eigenvalues, coordinates.powers, strict=True))
    partners = np.array([keys.index((value.conjugate(), power)) for value, power in keys])
    eigenvalues = np.array(coordinates.eigenvalues, dtype=np.complex128)
    powers, drivers = np.array(coordinates.powers), np.array(coordinates.drivers)
    a = np.zeros((len(eigenvalues), len(eigenvalues)), dtype=np.complex128)
    np.fill_diagonal(a, eigenvalues)
    a[powers == 1, drivers[powers == 1]] = 1.0
    distinct = np.flatnonzero(powers == 0)
    place = np.searchsorted(distinct, drivers)
    pairs = ModePairs(
        eigenvalues_1_s=np.add.outer(eigenvalues[distinct], eigenvalues[distinct].conj()),
        first=place[:, None],
        second=place,
        powers=np.add.outer(powers, powers),
    )
    return ModalForm(
        eigenvalues_1_s=eigenvalues,
        powers=powers,
        drivers=drivers,
        partners=partners,
        left_eigenvectors=left,
        eigenvectors=np.linalg.inv(left).astype(np.complex128),
        a=a,
        b=1.0 - powers,
        pairs=pairs,
    )
