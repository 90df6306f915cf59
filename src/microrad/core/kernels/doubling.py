"""Riccati and Lyapunov equations by doubling, for matrices as small as a controller's."""

from microrad.core.kernels.compiler import compiled_loop


@compiled_loop
def _product(left, right, out):  # type: ignore[no-untyped-def]
    """out = left right, row by row; out is another array than both."""
    for i in range(left.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
        for k in range(left.shape[1]):
            weight = left[i, k]
            for j in range(out.shape[1]):
                out[i, j] += weight * right[k, j]


@compiled_loop
def _transpose(matrix, out):  # type: ignore[no-untyped-def]
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[j, i] = matrix[i, j]


@compiled_loop
def _eliminate(matrix, right):  # type: ignore[no-untyped-def]
    """right = matrix^-1 right by Gauss with the largest pivot of each column; nothing is left in matrix."""
    n, columns = matrix.shape[0], right.shape[1]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= share * matrix[k, j]
                for j in range(columns):
                    right[i, j] -= share * right[k, j]
    for k in range(n - 1, -1, -1):
        pivot = matrix[k, k]
        for j in range(columns):
            right[k, j] /= pivot
        for i in range(k):
            share = matrix[i, k]
            if share != 0.0:
                for j in range(columns):
                    right[i, j] -= share * right[k, j]


@compiled_loop
def riccati_kernel(power, G, X, work, wide):  # type: ignore[no-untyped-def]
    """Doubles A, B R^-1 B' and Q into the solution X = A' X (I + G X)^-1 A + Q; whether it has settled.

    Structure-preserving doubling: Chu, Fan, Lin and Wang, International Journal of Control 77 (2004) 767.

    Args:
        power: A, shape (n, n); written over.
        G: B R^-1 B', symmetric, shape (n, n); written over.
        X: Q, symmetric, shape (n, n); the solution is left in it.
        work: Room, shape (4, n, n).
        wide: Room, shape (n, 2 n).
    """
    n = X.shape[0]
    first, second, other, more = work[0], work[1], work[2], work[3]
    for _ in range(60):
        _product(G, X, other)
        for i in range(n):
            other[i, i] += 1.0
            for j in range(n):
                wide[i, j], wide[i, n + j] = power[i, j], G[i, j]
        _eliminate(other, wide)
        for i in range(n):
            for j in range(n):
                first[i, j], second[i, j] = wide[i, j], wide[i, n + j]
        _transpose(power, other)
        _product(second, other, more)  # G += power second power'
        _product(power, more, second)
        _product(X, first, more)  # X += power' X first
        _product(other, more, wide[:, :n])
        _product(power, first, other)
        largest, moving = 0.0, False
        for i in range(n):
            for j in range(n):
                power[i, j] = other[i, j]
                X[i, j] += 0.5 * (wide[i, j] + wide[j, i])
                more[i, j] = G[i, j] + second[i, j]
                largest = max(largest, abs(X[i, j]))
        for i in range(n):
            moving = moving or abs(wide[i, i]) > 1e-14 * X[i, i]
            for j in range(n):
                G[i, j] = 0.5 * (more[i, j] + more[j, i])
        if not largest < 1e150:
            return False
        if not moving:
            return True
    return False


@compiled_loop
def gramian_kernel(power, X, work):  # type: ignore[no-untyped-def]
    """Doubles A and Q into the solution X = A' X A + Q, as `lti.gramian`.

    Args:
        power: A, stable, shape (n, n); written over.
        X: Q, symmetric, shape (n, n); the solution is left in it.
        work: Room, shape (3, n, n).
    """
    n = X.shape[0]
    turned, half, more = work[0], work[1], work[2]
    for _ in range(64):
        _transpose(power, turned)
        _product(X, power, half)
        _product(turned, half, more)
        moving = False
        for i in range(n):
            for j in range(n):
                X[i, j] += more[i, j]
            moving = moving or more[i, i] > 1e-15 * abs(X[i, i])
        if not moving:
            return
        _product(power, power, half)
        for i in range(n):
            for j in range(n):
                power[i, j] = half[i, j]
