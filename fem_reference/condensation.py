"""Static condensation: a linear solid seen from the unknowns on which forces depend on the displacements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

COLUMNS = 128  # unknowns that are condensed at a time: bounds the memory


class Condensation:
    """Schur complement of a symmetric stiffness (Guyan 1965; for a static solid it is exact).

    Args:
        stiffness: Of the free unknowns [N/m], shape (n, n).
        kept: Indices of the unknowns that stay, shape (m,).

    Attributes:
        kept: Unknowns that stay, shape (m,).
        rest: The others, shape (n - m,).
        reduced: Stiffness between those that stay, the others being in balance [N/m], shape (m, m).
    """

    def __init__(self, stiffness: sp.csr_matrix, kept: np.ndarray) -> None:
        self.kept = kept
        self.rest = np.setdiff1d(np.arange(stiffness.shape[0]), kept)
        rows = stiffness[self.rest]
        self._across = rows[:, kept].tocsc()
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
        self._factors = spl.splu(rows[:, self.rest].tocsc(), **options)
        self.reduced = stiffness[kept][:, kept].toarray()
        for start in range(0, len(kept), COLUMNS):
            at = slice(start, start + COLUMNS)
            self.reduced[:, at] -= self._across.T @ self._factors.solve(self._across[:, at].toarray())

    def pull(self, forces: np.ndarray) -> np.ndarray:
        """Forces on those that stay [N], shape (m,), by which forces on the others, (n - m,), can be replaced."""
        return -(self._across.T @ self._factors.solve(forces))

    def follow(self, step: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Change of all unknowns [m], shape (n,).

        Args:
            step: Change of those that stay [m], shape (m,).
            forces: Forces out of balance on the others before it [N], shape (n - m,).
        """
        out = np.empty(len(self.kept) + len(self.rest))
        out[self.kept] = step
        out[self.rest] = -self._factors.solve(forces + self._across @ step)
        return out
