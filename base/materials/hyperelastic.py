"""What a law answers to homogeneous stretch, in closed form: incompressible, in numpy, for any law of
base.materials.laws.

Everything comes from the slopes s_i = l_i dW/dl_i of the energy of principal stretches: the Cauchy stress of
an incompressible solid is s_i - p, and a free direction gives p. `material` is any object with a law's
parameters.
"""

import numpy as np


def _invariant_slopes(derivatives):
    """Slopes of a law W(I1, I2): s_i = 2 (W1 l_i^2 - W2 / l_i^2); `derivatives(material, I1, I2)` gives W1,
    W2."""

    def slopes(m, l):
        squares = l * l
        W1, W2 = derivatives(m, squares.sum(-1, keepdims=True), (1 / squares).sum(-1, keepdims=True))
        return 2 * (W1 * squares - W2 / squares)

    return slopes


def _yeoh(m, I1, I2):
    x = I1 - 3
    return m.c10 + 2 * m.c20 * x + 3 * m.c30 * x * x, 0.0


def _gent(m, I1, I2):
    left = 1 - (I1 - 3) / m.jm
    return np.where(left > 0, m.mu / 2 / np.where(left > 0, left, 1.0), np.nan), 0.0


def _ogden(m, l):
    return sum(2 * mu / alpha * l**alpha for mu, alpha in m.terms)


SLOPES = {
    "neo-Hookean": _invariant_slopes(lambda m, I1, I2: (m.mu / 2, 0.0)),
    "Mooney-Rivlin": _invariant_slopes(lambda m, I1, I2: (m.c10, m.c01)),
    "Yeoh": _invariant_slopes(_yeoh),
    "Gent": _invariant_slopes(_gent),
    "Ogden": _ogden,
}


def slopes(material, stretches):
    """s_i = l_i dW/dl_i in MPa, shape (..., 3), of principal stretches (..., 3); nan beyond Gent's limit."""
    return SLOPES[material.law](material, np.asarray(stretches, float))


#: mode -> principal stretches when the pulled direction has stretch l; the last is the free one
MODES = {
    "uniaxial": lambda l: np.stack([l, l**-0.5, l**-0.5], -1),
    "equibiaxial": lambda l: np.stack([l, l, l**-2.0], -1),
    "pure shear": lambda l: np.stack([l, np.ones_like(l), 1 / l], -1),
}


def nominal_stress(material, mode, stretch):
    """Force per undeformed area (MPa) in the pulled direction, shape of `stretch`; mode is a key of MODES."""
    l = np.asarray(stretch, float)
    s = slopes(material, MODES[mode](l))
    return (s[..., 0] - s[..., 2]) / l


def shear_stress(material, amount):
    """Shear stress (MPa) at a simple shear by `amount` = l - 1/l: dW/d(amount)."""
    g = np.asarray(amount, float)
    l = g / 2 + np.sqrt(1 + g * g / 4)
    s = slopes(material, MODES["pure shear"](l))
    return (s[..., 0] - s[..., 2]) / (l + 1 / l)


def stable_stretch(material, mode, largest=10.0):
    """The stretch at which the law stops being stable in this mode; inf when it is stable up to `largest`.

    Drucker: the Hessian of W in the two free logarithmic strains is positive definite, so that any further
    stretch costs work. Gent's law counts as stable up to its limit.
    """
    l = np.geomspace(1.001, largest, 400)
    e = np.log(MODES[mode](l))
    step = 1e-5
    hessian = np.empty((len(l), 2, 2))
    for j in range(2):
        shift = step * (np.eye(3)[j] - np.eye(3)[2])
        up, down = slopes(material, np.exp(e + shift)), slopes(material, np.exp(e - shift))
        change = (up - down) / (2 * step)
        hessian[:, :, j] = change[:, :2] - change[:, 2:]
    (a, b), (c, d) = hessian.transpose(1, 2, 0)
    trace, determinant = a + d, a * d - b * c
    unstable = (trace <= 0) | (determinant <= 0)  # false where nan
    return float(l[np.argmax(unstable)]) if unstable.any() else np.inf
