"""Constant matrices of a chain of links: arms, masses, damping, and its fastest mode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_rig.load_params import LinkParams, LoadParams

FloatArray = NDArray[np.float64]


class ChainMatrices:
    """Matrices of n links; the small motion in either plane is M q'' + D q' + K q = -c p''."""

    def __init__(self, links: Sequence[LinkParams], load: LoadParams) -> None:
        lengths = np.array([link.length_m for link in links])
        masses = np.array([link.mass_kg for link in links])
        is_bar = np.array([link.kind == "bar" for link in links])
        tip_kg = load.tip_mass_kg
        n = len(lengths)
        centres = np.where(is_bar, 0.5, 1.0)
        # (n, n) place of mass k = sum over j of arms[k, j] times the direction of link j [m]
        self.arms: FloatArray = np.tril(np.tile(lengths, (n, 1)), -1) + np.diag(lengths * centres)
        inertias = np.where(is_bar, masses * lengths**2 / 12.0, 0.0)
        self.mass: FloatArray = (
            self.arms.T @ (masses[:, None] * self.arms)
            + np.diag(inertias)
            + tip_kg * np.outer(lengths, lengths)
        )  # (n, n) [kg m^2]
        self.coupling: FloatArray = masses @ self.arms + tip_kg * lengths  # (n,) [kg m]
        self.inverse: FloatArray = np.linalg.inv(self.mass)
        self.load_mass_kg = float(masses.sum()) + tip_kg
        springs = _joint_matrix([link.joint_stiffness_n_m_rad for link in links])
        dampers = _joint_matrix([link.joint_damping_n_m_s_rad for link in links])
        stiffness = springs + np.diag(load.gravity_m_s2 * self.coupling)
        # (n, n) [N m s/rad]; gives every mode the damping ratio, without the dampers of the joints
        self.damping = self._modal_damping(stiffness, load.damping_ratio)
        self.fastest_rad_s = self._fastest_rad_s(stiffness, dampers)

    def _modal_damping(self, stiffness: FloatArray, ratio: float) -> FloatArray:
        """Compute D = M V diag(2 zeta w) V' M with V' M V = 1 and K V = M V diag(w^2)."""
        if ratio == 0.0:
            return np.zeros_like(self.mass)
        root = np.linalg.cholesky(self.mass)
        half = np.linalg.solve(root, np.linalg.solve(root, stiffness).T)
        squares, vectors = np.linalg.eigh((half + half.T) / 2.0)
        shapes = root @ vectors
        return np.asarray(2.0 * ratio * (shapes * np.sqrt(squares)) @ shapes.T)

    def _fastest_rad_s(self, stiffness: FloatArray, dampers: FloatArray) -> float:
        n = len(self.coupling)
        rates = np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [-self.inverse @ stiffness, -self.inverse @ (self.damping + dampers)],
            ]
        )
        return float(np.abs(np.linalg.eigvals(rates)).max())


def _joint_matrix(values: list[float]) -> FloatArray:
    """Assemble the matrix of joints at the upper ends, for angles against the vertical: (n, n)."""
    matrix = np.zeros((len(values), len(values)))
    for i, value in enumerate(values):
        matrix[i, i] += value
        if i:
            matrix[i - 1, i - 1] += value
            matrix[i, i - 1] -= value
            matrix[i - 1, i] -= value
    return matrix
