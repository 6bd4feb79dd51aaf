"""The rotation of least squares between matched points, compiled, without a call into LAPACK."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# A 4x4 matrix is diagonal to the last bit after five or six rounds; more are a sign of values that are not finite.
ROUNDS = 20


@njit(cache=True)
def rotation_of_covariance(covariance: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
    """Write the rotation that maps source offsets onto target offsets best (Horn 1987, by unit quaternions).

    The quaternion is the eigenvector of the largest eigenvalue of Horn's symmetric 4x4 matrix, found by Jacobi's
    rotations. It is a rotation, never a reflection, also where the points lie in a plane; where several are equally
    good (points on a line, or one point) it is one of them.

    Args:
        covariance: (3, 3), sum over pairs of source offset (rows) times target offset (columns).
        rotation: (3, 3), written.
    """
    sxx, sxy, sxz = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    syx, syy, syz = covariance[1, 0], covariance[1, 1], covariance[1, 2]
    szx, szy, szz = covariance[2, 0], covariance[2, 1], covariance[2, 2]
    matrix = np.empty((4, 4))
    matrix[0, 0] = sxx + syy + szz
    matrix[1, 1] = sxx - syy - szz
    matrix[2, 2] = syy - sxx - szz
    matrix[3, 3] = szz - sxx - syy
    matrix[0, 1] = syz - szy
    matrix[0, 2] = szx - sxz
    matrix[0, 3] = sxy - syx
    matrix[1, 2] = sxy + syx
    matrix[1, 3] = szx + sxz
    matrix[2, 3] = syz + szy
    vectors = np.eye(4)
    _diagonalise(matrix, vectors)
    best = 0
    for column in range(1, 4):
        if matrix[column, column] > matrix[best, best]:
            best = column
    w, x, y, z = vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best]
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    rotation[0, 0] = 1 - scale * (y * y + z * z)
    rotation[0, 1] = scale * (x * y - w * z)
    rotation[0, 2] = scale * (x * z + w * y)
    rotation[1, 0] = scale * (x * y + w * z)
    rotation[1, 1] = 1 - scale * (x * x + z * z)
    rotation[1, 2] = scale * (y * z - w * x)
    rotation[2, 0] = scale * (x * z - w * y)
    rotation[2, 1] = scale * (y * z + w * x)
    rotation[2, 2] = 1 - scale * (x * x + y * y)


@njit(cache=True)
def _diagonalise(matrix: NDArray[np.float64], vectors: NDArray[np.float64]) -> None:
    """Turn a symmetric matrix, of which the upper triangle is read, into its eigenvalues; vectors into eigenvectors."""
    size = len(matrix)
    for _ in range(ROUNDS):
        off, on = 0.0, 0.0
        for row in range(size):
            on += matrix[row, row] ** 2
            for column in range(row + 1, size):
                off += matrix[row, column] ** 2
        if off <= 1e-32 * on:
            return
        for row in range(size):
            for column in range(row + 1, size):
                value = matrix[row, column]
                if value == 0.0:
                    continue
                # The smaller of the two angles that make this entry zero (Golub and Van Loan, section 8.5).
                ratio = (matrix[column, column] - matrix[row, row]) / (2.0 * value)
                tangent = 1.0 / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
                if ratio < 0:
                    tangent = -tangent
                cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
                sine = tangent * cosine
                matrix[row, row] -= tangent * value
                matrix[column, column] += tangent * value
                matrix[row, column] = 0.0
                for other in range(size):
                    if other not in (row, column):
                        i, j = (other, row) if other < row else (row, other)
                        k, m = (other, column) if other < column else (column, other)
                        first, second = matrix[i, j], matrix[k, m]
                        matrix[i, j] = cosine * first - sine * second
                        matrix[k, m] = sine * first + cosine * second
                    first, second = vectors[other, row], vectors[other, column]
                    vectors[other, row] = cosine * first - sine * second
                    vectors[other, column] = sine * first + cosine * second
