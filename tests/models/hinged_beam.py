"""A finely divided beam, for tests and benches."""

import numpy as np
import scipy.sparse as sp


def matrices(elements, h):
    """M, K (CSC) of an Euler beam on hinges by cubic elements of length h with lumped mass, and the coordinate of its middle.

    Bending stiffness and mass per length are 1.
    """
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
                  [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
    m = np.array([h / 2, h**3 / 24, h / 2, h**3 / 24])
    places = 2 * np.arange(elements)[:, None] + np.arange(4)
    rows, columns = np.repeat(places, 4, axis=1).ravel(), np.tile(places, (1, 4)).ravel()
    n = 2 * (elements + 1)
    K = sp.csc_matrix((np.tile(k.ravel(), elements), (rows, columns)), shape=(n, n))
    M = sp.csc_matrix((np.tile(m, elements), (places.ravel(), places.ravel())), shape=(n, n))
    free = np.setdiff1d(np.arange(n), [0, n - 2])
    K, M = K[free][:, free], M[free][:, free]
    middle = int(np.searchsorted(free, 2 * (elements // 2)))
    return M, K, middle
