"""A least-squares problem in hardly more rows than it has parameters.

The triangular factor of residuals and Jacobian side by side,

    (r  J) = Q (|r|  s),    Q^T Q = 1,
               ( 0   R)

holds |r|, J^T r = |r| s and J^T J = s^T s + R^T R, which is all that a Gauss-Newton method asks of
r and J: n + 1 rows in place of thousands of samples.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROWS_AT_ONCE = 512
"""Rows factored together: in a core's cache, and too few for BLAS to wake other threads, for which
it would wait where the cores are busy."""


def condensed_residuals(r: Array, parameters: int) -> Array:
    """(|r|, 0, ..., 0), (parameters + 1,)."""
    return np.concatenate([[float(np.linalg.norm(r))], np.zeros(parameters)])


def condensed_jacobian(r: Array, jacobian: Array) -> Array:
    """s above R, (n + 1, n), of r (samples,) and its Jacobian (samples, n)."""
    factor = triangle(np.column_stack([r, jacobian]))
    return np.copysign(1.0, np.diag(factor))[:, np.newaxis] * factor[:, 1:]


def triangle(matrix: Array) -> Array:
    """Triangular factor (n, n) of a matrix (m, n), m >= n, whose signs are nobody's."""
    rows, columns = matrix.shape
    blocks = -(-rows // ROWS_AT_ONCE)
    padded = np.zeros((blocks * ROWS_AT_ONCE, columns))
    padded[:rows] = matrix
    factors = np.asarray(np.linalg.qr(padded.reshape(blocks, ROWS_AT_ONCE, columns), mode="r"))
    return np.asarray(np.linalg.qr(factors.reshape(-1, columns), mode="r"), dtype=np.float64)
