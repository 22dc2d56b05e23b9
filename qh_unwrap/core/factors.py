# SPDX-License-Identifier: GPL-3.0-or-later
"""Factorizations of sparse matrices, with what precision they need.

A `Factorizer` takes a matrix whose unknowns are in the order in which they are to be eliminated and returns its
`Factors`.  `superlu` is SciPy's; another library takes part by offering the same.
"""

from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from .errors import SingularError

_CORRECTIONS = 6  # at most so many times a solution in single precision is corrected,
_EXACT = 1e-6  # until the next correction would be smaller than this, relative to the solution


class Factors(Protocol):
    """A factorized matrix."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """The solution (n, c) of right-hand sides (n, c), to the factors' precision."""
        ...

    def solve_exactly(self, rhs: np.ndarray) -> np.ndarray:
        """The same as exactly as positions need it."""
        ...

    def sharpened(self) -> bool:
        """Factorize in double precision, unless that is done: then it returns False."""
        ...


class Factorizer(Protocol):
    def __call__(self, matrix: csc_array, single: bool) -> Factors:
        """The factors of a matrix, if `single` in single precision, which takes less time and memory."""
        ...


class superlu:  # noqa: N801 (it is called like a function, as a `Factorizer`)
    """L and U by SciPy's SuperLU, of a matrix in its own order.

    The matrices are dominated by their diagonals: no column ordering, no pivoting.  And they are so sparse
    that panels of several columns would only be mostly empty.
    """

    def __init__(self, matrix: csc_array, single: bool):
        self._matrix = matrix
        self._kind = np.float32 if single else np.float64
        self._factorize()

    def _factorize(self):
        try:
            with np.errstate(over="ignore"):
                matrix = self._matrix.astype(self._kind, copy=False)
            if not np.isfinite(matrix.data).all():  # where SuperLU would read beyond its memory now and then
                raise RuntimeError("the matrix is not finite")
            options = {"SymmetricMode": True}
            self._factors = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, panel_size=1, options=options)
        except RuntimeError:
            if not self.sharpened():
                text = "its equations have no solution: merge its vertices by distance, or mark seams"
                raise SingularError(text) from None

    def sharpened(self) -> bool:
        if self._kind == np.float64:
            return False
        self._kind, self._factors = np.float64, None
        self._factorize()
        return True

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        if self._kind == np.float64:
            return np.ascontiguousarray(self._factors.solve(rhs))
        with np.errstate(over="ignore"):
            solution = self._factors.solve(rhs.astype(self._kind, order="F", copy=False))  # as SuperLU has it
        return solution.astype(np.float64, order="C", copy=False)

    def solve_exactly(self, rhs: np.ndarray) -> np.ndarray:
        """By corrections (Wilkinson's iterative refinement) where the factors are in single precision."""
        solution = self.solve(rhs)
        if self._kind == np.float64:
            return solution
        size = np.linalg.norm(solution)
        for _ in range(_CORRECTIONS):
            correction = self.solve(rhs - self._matrix @ solution)
            solution += correction
            before, size = size, np.linalg.norm(correction)
            if size == 0 or size * (size / before) <= _EXACT * np.linalg.norm(solution):
                return solution
        self.sharpened()
        return self.solve(rhs)
