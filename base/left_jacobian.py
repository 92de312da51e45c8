"""How poses exp(X) change with their twists: the left Jacobian of SE(3) and its derivative, as polynomials in
ad.

Twists are (rotation, translation) and wrenches (moment, force), as in base.se3. With ad the 6x6 matrix of the
commutator, J = sum ad^n/(n+1)!; as ad^5 = -2 t ad^3 - t^2 ad with t = |w|^2 the sum ends at ad^4, with
coefficients that are entire functions of t (closed forms: Barfoot & Furgale, IEEE Trans. Robotics 30, 2014;
here their power series, which have no special case at t = 0).
"""

from math import factorial

import numpy as np

from pneunet.base.se3 import hat

TERMS = 16  # exact to rounding for turns up to 4 rad


def _series():
    """(TERMS, 8) coefficients of the powers of t in a1..a4 of J = 1 + a1 ad + .. + a4 ad^4, and in their
    derivatives by t."""
    j = range(1, TERMS + 1)
    first = [(-1) ** (i + 1) * (2 - i) / factorial(2 * i) for i in j]
    second = [(-1) ** i * (i - 2) / factorial(2 * i + 1) for i in j]
    third = [(-1) ** (i + 1) * i / factorial(2 * i + 2) for i in j]
    fourth = [(-1) ** (i + 1) * i / factorial(2 * i + 3) for i in j]
    values = np.array([first, second, third, fourth]).T
    slopes = np.zeros_like(values)
    slopes[:-1] = values[1:] * np.arange(1, TERMS)[:, None]
    return np.hstack([values, slopes])


_SERIES = _series()


def commutator(twist: np.ndarray) -> np.ndarray:
    """ad (n, 6, 6) of twists (n, 6): ad(X) Y is the twist of the matrices' X Y - Y X."""
    W = hat(twist[:, :3])
    out = np.zeros((len(twist), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = W
    out[:, 3:, :3] = hat(twist[:, 3:])
    return out


def adjoint(pose: np.ndarray) -> np.ndarray:
    """Ad (n, 6, 6) of poses (n, 4, 4): a twist in a frame's axes seen from where the frame stands."""
    R = pose[:, :3, :3]
    out = np.zeros((len(pose), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = R
    out[:, 3:, :3] = hat(pose[:, :3, 3]) @ R
    return out


def wrench_commutator(wrench: np.ndarray) -> np.ndarray:
    """C (n, 6, 6) of wrenches (n, 6) with ad(X)^T w = C(w) X."""
    moment, force = hat(wrench[:, :3]), hat(wrench[:, 3:])
    out = np.zeros((len(wrench), 6, 6))
    out[:, :3, :3], out[:, :3, 3:], out[:, 3:, :3] = moment, force, force
    return out


class LeftJacobian:
    """matrix: J (n, 6, 6) of twists (n, 6), d exp(X) = hat_pose(J dX) exp(X); exact to rounding for turns up
    to 4 rad."""

    def __init__(self, twist: np.ndarray) -> None:
        self._twist = twist
        self._along = np.zeros_like(twist)  # dt/2 by the twist
        self._along[:, :3] = twist[:, :3]
        t = np.sum(twist[:, :3] ** 2, axis=1)
        powers = np.empty((len(t), TERMS))
        powers[:, 0], powers[:, 1:] = 1.0, t[:, None]
        #: (8, n, 1, 1): a1..a4 and their derivatives by t
        self._a = (np.multiply.accumulate(powers, axis=1) @ _SERIES).T[:, :, None, None]
        self._ad = commutator(twist)
        ad2, a = self._ad @ self._ad, self._a
        self.matrix = a[0] * self._ad + a[1] * ad2 + (a[2] * self._ad + a[3] * ad2) @ ad2
        self.matrix += np.eye(6)

    @property
    def pose(self) -> np.ndarray:
        """exp(X) (n, 4, 4): its rotation and translation are in J."""
        V, out = self.matrix[:, :3, :3], np.zeros((len(self._twist), 4, 4))
        out[:, :3, :3] = np.eye(3) + self._ad[:, :3, :3] @ V
        out[:, :3, 3] = (V @ self._twist[:, 3:, None])[:, :, 0]
        out[:, 3, 3] = 1.0
        return out

    def slope(self, wrench: np.ndarray) -> np.ndarray:
        """(n, 6, 6): derivative by the twist of J^T w, for constant wrenches (n, 6)."""
        transposed, a, n = np.swapaxes(self._ad, 1, 2), self._a, len(wrench)
        y = np.empty((5, n, 6, 1))  # (ad^T)^i w
        y[0] = wrench[:, :, None]
        for i in range(4):
            np.matmul(transposed, y[i], out=y[i + 1])
        C = wrench_commutator(y[:4].reshape(-1, 6)).reshape(4, n, 6, 6)
        # derivative of y[i + 1]: Y[i] = C(y[i]) + ad^T Y[i - 1]
        Y, out = C[0], a[0] * C[0]
        for i in range(1, 4):
            Y = C[i] + transposed @ Y
            out += a[i] * Y
        return out + (a[4:] * y[1:]).sum(axis=0) * (2 * self._along[:, None])
