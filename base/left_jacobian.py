"""How poses exp(X) change with their twists: the left Jacobian of SE(3) and its derivative, as polynomials in ad.

Twists are (rotation, translation) and wrenches (moment, force), as in base.se3. With ad the 6x6 matrix of the commutator,
J = sum ad^n/(n+1)!; as ad^5 = -2 t ad^3 - t^2 ad with t = |w|^2 the sum ends at ad^4, with coefficients that are entire functions of t
(closed forms: Barfoot & Furgale, IEEE Trans. Robotics 30, 2014; here their power series, which have no special case at t = 0).
"""

from math import factorial

import numpy as np

from base.se3 import hat

TERMS = 16  # exact to rounding for turns up to 4 rad


def _series():
    """(TERMS, 8) coefficients of the powers of t in a1..a4 of J = 1 + a1 ad + .. + a4 ad^4, and in their derivatives by t."""
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


def _coefficients(twist):
    """(n, 4) a1..a4 and (n, 4) their derivatives by t, for twists (n, 6) that turn by at most 4 rad."""
    t = np.sum(twist[:, :3] ** 2, axis=1)
    powers = np.empty((len(t), TERMS))
    powers[:, 0], powers[:, 1:] = 1.0, t[:, None]
    found = np.multiply.accumulate(powers, axis=1) @ _SERIES
    return found[:, :4], found[:, 4:]


def commutator(twist):
    """ad (n, 6, 6) of twists (n, 6): ad(X) Y is the twist of the matrices' X Y - Y X."""
    W = hat(twist[:, :3])
    out = np.zeros((len(twist), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = W
    out[:, 3:, :3] = hat(twist[:, 3:])
    return out


def adjoint(pose):
    """Ad (n, 6, 6) of poses (n, 4, 4): a twist in a frame's axes seen from where the frame stands."""
    R = pose[:, :3, :3]
    out = np.zeros((len(pose), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = R
    out[:, 3:, :3] = hat(pose[:, :3, 3]) @ R
    return out


def wrench_commutator(wrench):
    """C (n, 6, 6) of wrenches (n, 6) with ad(X)^T w = C(w) X."""
    moment, force = hat(wrench[:, :3]), hat(wrench[:, 3:])
    out = np.zeros((len(wrench), 6, 6))
    out[:, :3, :3], out[:, :3, 3:], out[:, 3:, :3] = moment, force, force
    return out


def left_jacobian(twist):
    """J (n, 6, 6) of twists (n, 6): d exp(X) = hat(J dX) exp(X)."""
    a, ad = _coefficients(twist)[0][:, :, None, None], commutator(twist)
    ad2 = ad @ ad
    return np.eye(6) + a[:, 0] * ad + a[:, 1] * ad2 + (a[:, 2] * ad + a[:, 3] * ad2) @ ad2


def left_jacobian_slope(twist, wrench):
    """D (n, 6, 6): derivative by the twist of J(twist)^T w, for twists (n, 6) and constant wrenches (n, 6)."""
    a, slope = _coefficients(twist)
    transposed = np.swapaxes(commutator(twist), 1, 2)
    along = np.zeros((len(twist), 6))  # dt/2
    along[:, :3] = twist[:, :3]
    y, Y = wrench, np.zeros((len(twist), 6, 6))
    out = np.zeros((len(twist), 6, 6))
    for i in range(4):
        # y = ad^T y and its derivative Y
        Y = wrench_commutator(y) + transposed @ Y
        y = (transposed @ y[:, :, None])[:, :, 0]
        out += a[:, i, None, None] * Y + (2 * slope[:, i, None] * y)[:, :, None] * along[:, None]
    return out
