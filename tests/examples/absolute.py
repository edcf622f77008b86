"""A second, independent look at Tables for tests: M and K in absolute small coordinates and the null space of the
constraints.

Small rotations about world axes at the centres of mass (docs/theory.md (5.7) to (5.10)); unloaded springs, so without geometric
stiffness. It knows nothing of mbrs but the layout in docs/tables.md.
"""

from __future__ import annotations

import numpy as np

# Blocked directions of the joint frame: translations 0..2, rotations 3..5 (docs/tables.md, joint constraint rows).
BLOCKED = {
    0: (0, 1, 2, 3, 4, 5),
    1: (0, 1, 2, 3, 4),
    2: (0, 1, 3, 4, 5),
    3: (0, 1, 3, 4),
    4: (0, 1, 2, 4),
    5: (0, 1, 2),
    6: (2, 3, 4),
    7: (),
}
FREE = {1: (5,), 2: (2,), 3: (2, 5), 5: (3, 4, 5), 6: (0, 1, 5), 7: (0, 1, 2, 3, 4, 5)}


def rotation_matrix(q):
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def frame_from_axis(z):
    z = z / np.linalg.norm(z)
    e = np.eye(3)[np.argmin(np.abs(z))]
    x = e - (e @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def skew(r):
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


class Absolute:
    def __init__(self, t):
        self.t, self.x = t, t["x"]
        self.n = len(t["body_x"])
        self.centre, self.M = [], np.zeros((6 * self.n, 6 * self.n))
        for i, s in enumerate(t["body_x"]):
            b = self.x[s : s + 23]
            R = rotation_matrix(b[3:7])
            self.centre.append(b[0:3] + R @ b[7:10])
            xx, yy, zz, xy, xz, yz = b[11:17]
            self.M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = b[10] * np.eye(3)
            J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            self.M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = R @ J @ R.T
        self.K, self.C, rows = self._stiffness()
        self.J = np.array(rows).reshape(-1, 6 * self.n)

    def relative(self, a, b, point_a, point_b, R):
        """(6, 6n): displacement and rotation of b relative to a, in the frame R."""
        G = np.zeros((6, 6 * self.n))
        for body, point, sign in ((a, point_a, -1.0), (b, point_b, 1.0)):
            if body >= 0:
                T = np.eye(6)
                T[:3, 3:] = -skew(point - self.centre[body])
                G[:, 6 * body : 6 * body + 6] += sign * T
        return np.kron(np.eye(2), R.T) @ G

    def _stiffness(self):
        t, x = self.t, self.x
        K = np.zeros((6 * self.n, 6 * self.n))
        C, rows = np.zeros_like(K), []
        for kind, a, b, s in zip(t["element_type"], t["element_a"], t["element_b"], t["element_x"], strict=True):
            if kind == 0:
                u = (x[s + 3 : s + 6] - x[s : s + 3]) / np.linalg.norm(x[s + 3 : s + 6] - x[s : s + 3])
                g = np.r_[u, 0, 0, 0] @ self.relative(a, b, x[s : s + 3], x[s + 3 : s + 6], np.eye(3))
                K += x[s + 6] * np.outer(g, g)
                C += x[s + 7] * np.outer(g, g)
            elif kind == 1:
                G = self.relative(a, b, x[s : s + 3], x[s + 3 : s + 6], rotation_matrix(x[s + 6 : s + 10]))
                K += G.T @ x[s + 10 : s + 46].reshape(6, 6) @ G
                C += G.T @ x[s + 46 : s + 82].reshape(6, 6) @ G
            else:
                axis = x[s + 3 : s + 6] / np.linalg.norm(x[s + 3 : s + 6])
                g = np.r_[0, 0, 0, axis] @ self.relative(a, b, x[s : s + 3], x[s : s + 3], np.eye(3))
                K += x[s + 6] * np.outer(g, g)
                C += x[s + 7] * np.outer(g, g)
        for kind, a, b, flags, s in zip(
            t["joint_type"], t["joint_a"], t["joint_b"], t["joint_flags"], t["joint_x"], strict=True
        ):
            R = rotation_matrix(x[s + 12 : s + 16]) if flags & 8 else frame_from_axis(x[s + 6 : s + 9])
            G = self.relative(a, b, x[s : s + 3], x[s + 3 : s + 6], R)
            rows.extend(G[list(BLOCKED[int(kind)])])
            for i, row in enumerate(FREE.get(int(kind), ())):
                K += x[s + 16 + i] * np.outer(G[row], G[row])
                C += x[s + 22 + i] * np.outer(G[row], G[row])
        return K, C, rows

    def null_space(self):
        if len(self.J) == 0:
            return np.eye(6 * self.n)
        _, s, vt = np.linalg.svd(self.J)
        rank = int((s > 1e-9 * s[0]).sum())
        return vt[rank:].T

    def degrees_of_freedom(self):
        return self.null_space().shape[1]

    def frequencies(self):
        """Undamped, Hz, ascending; rigid modes come out near zero."""
        B = self.null_space()
        L = np.linalg.cholesky(B.T @ self.M @ B)
        A = np.linalg.solve(L, np.linalg.solve(L, (B.T @ self.K @ B)).T)
        return np.sqrt(np.clip(np.linalg.eigvalsh(A), 0, None)) / (2 * np.pi)
