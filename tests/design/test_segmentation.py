import numpy as np
import pytest

from pneunet.base import se3
from pneunet.design.segmentation.rod import Rod, advance

ROD = Rod(
    se3.exp_pose(np.array([0.4, -1.0, 2.0, 5.0, -6.0, 7.0])),
    np.array([40.0, 75.0, 110.0]),
    np.array([[0.0, 0.03], [0.02, 0.0], [0.0, 0.0], [-0.015, -0.02]]),
)
STATIONS = np.array([-3.0, 10, 39, 41, 60, 90, 109, 111, 150, 400])


def screws(strains):
    k1, k2 = np.moveaxis(np.asarray(strains), -1, 0)
    return np.stack([k1, k2, 0 * k1, 1 + 0 * k1, 0 * k1, 0 * k1], axis=-1)


@pytest.mark.parametrize("u", [-70.0, -2.0, 1e-3, 0.5, 3.0, 90.0])
def test_a_piece_leads_where_the_exponential_does(u):
    strains = np.array([[0.0, 0.0], [0.03, 0.0], [0.0, -0.04], [-0.02, 0.03], [1e-6, 1e-5]])
    points, frames, *_ = advance(strains, np.full(5, u))
    poses = se3.exp_pose(u * screws(strains))
    assert np.allclose(points, poses[:, :3, 3], atol=1e-11, rtol=1e-11)
    assert np.allclose(frames, poses[:, :3, :3], atol=1e-13)


def moved(rod, parameter, step):
    """The rod with one parameter changed."""
    n = len(rod.strains)
    x = np.concatenate([np.zeros(6), rod.joints, rod.strains.ravel()])
    x[parameter] += step
    start = rod.start.copy()
    start[:3, :3] = se3.exp_rotation(x[:3]) @ start[:3, :3]
    start[:3, 3] += x[3:6]
    return Rod(start, x[6 : 5 + n], x[5 + n :].reshape(n, 2))


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_slopes_agree_with_differences(scale):
    """Points and frames at given arc lengths, by every parameter; small strains go through the series."""
    rod = Rod(ROD.start, ROD.joints, scale * ROD.strains)
    station = rod.at(STATIONS)
    velocities, rotations = rod.slopes(station)
    back = np.swapaxes(station.frames, 1, 2)
    for parameter in range(velocities.shape[2]):
        step = 1e-5 if parameter < 9 else 1e-7
        ahead, behind = (moved(rod, parameter, sign * step).at(STATIONS) for sign in (1, -1))
        change = (back @ ((ahead.points - behind.points) / (2 * step))[..., None])[..., 0]
        turn = back @ (ahead.frames - behind.frames) / (2 * step)
        size = max(1.0, abs(change).max())
        assert np.allclose(change, velocities[:, :, parameter], atol=3e-8 * size)
        spin = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
        assert np.allclose(spin, rotations[:, :, parameter], atol=3e-8 * max(1.0, abs(spin).max()))


def test_cuts_change_nothing():
    cut = ROD.cut(np.array([20.0, 50.0, 130.0]))
    assert len(cut.strains) == 7
    assert np.allclose(cut.at(STATIONS).points, ROD.at(STATIONS).points, atol=1e-12)
