"""Curves around a body: the shipped wraps from profiles and from triangles, and what no path can be laid
on."""

import numpy as np
import pytest

from examples import make_targets
from pneunet.base.errors import InputError
from pneunet.base.files.stl import read_stl
from pneunet.design.target.file import SHIPPED, read_target
from pneunet.design.target.wrap import Revolution, Triangulated, WrapPath, wrap

EXAMPLES = SHIPPED.parents[1] / "examples" / "wraps"
ROUNDING = 0.5e-4  # of the shipped CSVs


@pytest.mark.parametrize("name", make_targets.WRAPS)
def test_vase_and_pear_come_out_of_their_profiles_as_shipped(name):
    found, shipped = read_target(EXAMPLES / f"{name}.toml"), read_target(SHIPPED / f"{name}.csv")
    assert abs(found.points - shipped.points).max() <= ROUNDING + 1e-6
    assert abs(found.points - make_targets.TARGETS[name]()).max() < 1e-6


def test_around_a_cylinder_a_path_is_a_helix_of_known_length():
    cylinder = Revolution(lambda z: 20 + 0 * z, lambda z: 0 * z)
    points = wrap(cylinder, WrapPath(5.0, -2.0, 90.0, (10, 40)))
    assert np.hypot(*points[:, :2].T) == pytest.approx(np.full(201, 25.0))
    assert points[0] == pytest.approx([0, 25, 10]) and points[-1] == pytest.approx([0, 25, 40])
    assert points[1, 0] > 0  # clockwise from above
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(np.hypot(4 * np.pi * 25, 30), rel=2e-4)  # of chords of 3.6 degrees


def triangles(radius, top, around=90, up=60):
    angle, z = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, top, up + 1))
    p = np.stack([radius(z) * np.cos(angle), radius(z) * np.sin(angle), z], axis=2)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def stl(path, corners, text):
    if text:
        facets = ("outer loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) for t in corners)
        path.write_text("solid a\n" + "endloop\n".join(facets))
    else:
        record = np.zeros(len(corners), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("_", "<u2")])
        record["c"] = corners
        head = b"solid but binary".ljust(80)
        path.write_bytes(head + len(corners).to_bytes(4, "little") + record.tobytes())
    return path


@pytest.mark.parametrize("text", [True, False])
def test_triangles_of_an_stl_are_read_and_wrapped(tmp_path, text):
    corners = triangles(make_targets.vase_radius, 100)
    path = stl(tmp_path / "vase.stl", corners / 1e3, text)
    assert read_stl(path) == pytest.approx(corners / 1e3, abs=1e-8)
    (tmp_path / "a.toml").write_text(
        '[wrap]\nstl = "vase.stl"\nstl_unit = "m"\nstandoff_mm = 6\nturns = 0.9\nz_mm = [15, 85]'
    )
    found = read_target(tmp_path / "a.toml")
    # facets of 4 degrees lie within r (1 - cos 2 deg) = 0.02 mm of the surface
    assert abs(found.points - make_targets.vase()).max() < 0.03


def test_triangles_may_face_either_way():
    corners = triangles(lambda z: 20 + 0 * z, 50)
    path = WrapPath(5.0, 0.5, z_range=(10, 40))
    assert wrap(Triangulated(corners), path) == pytest.approx(wrap(Triangulated(corners[:, ::-1]), path))
    with pytest.raises(InputError, match="no surface at angle 0 deg, z = 10 mm: does the z axis run through"):
        wrap(Triangulated(corners + [0, 0, 100]), path)


PATH = "standoff_mm = 6\nturns = 0.9\nz_mm = [15, 85]\n"


@pytest.mark.parametrize(
    "text, words",
    [
        (PATH, "give one of 'profile' (a CSV of r_mm and z_mm) or 'stl'"),
        ("profile = 3\n" + PATH, "'profile' names a file"),
        ('profile = "p.csv"\nturns = 0.9\nz_mm = [15, 85]', "key 'standoff_mm' is missing"),
        ('profile = "p.csv"\nstandoff_mm = 6\nturns = 1', "'z_mm' must be [from, to]"),
        ('profile = "p.csv"\n' + PATH.replace("85", "105"), "z_mm must lie within the profile's 0..100 mm"),
        ('profile = "p.csv"\n' + PATH.replace("6", "-30"), "takes the curve through the axis"),
        ('profile = "p.csv"\nstl_unit = "m"\n' + PATH, "'stl_unit' goes with 'stl'"),
        ('profile = "short.csv"\n' + PATH, "2 rows of r and z: a profile needs at least 4"),
        ('profile = "back.csv"\n' + PATH, "z = 10 and 5 mm: z must rise from row to row"),
        ('profile = "x.csv"\n' + PATH, "column 'r_mm' is missing"),
        ('stl = "p.csv"\n' + PATH, "p.csv: is no STL, or is damaged"),
        ('stl = "empty.stl"\n' + PATH, "holds no triangles"),
        ('stl = "two.stl"\n' + PATH, "holds vertices that make no triangles"),
        ('profile = "p.csv"\nturn = 1\n' + PATH, "unknown key 'turn': did you mean 'turns'"),
    ],
)
def test_bad_wraps(tmp_path, text, words):
    (tmp_path / "p.csv").write_text("r_mm,z_mm\n20,0\n21,30\n22,60\n20,100\n")
    (tmp_path / "short.csv").write_text("r_mm,z_mm\n20,0\n21,30\n")
    (tmp_path / "back.csv").write_text("r_mm,z_mm\n20,0\n21,10\n22,5\n20,20\n")
    (tmp_path / "x.csv").write_text("x_mm,z_mm\n20,0\n21,10\n22,15\n20,20\n")
    (tmp_path / "empty.stl").write_text("solid nothing\nendsolid\n")
    (tmp_path / "two.stl").write_text("solid a\nvertex 0 0 0\nvertex 1 0 0\n")
    (tmp_path / "a.toml").write_text(f"[wrap]\n{text}")
    with pytest.raises(InputError) as error:
        read_target(tmp_path / "a.toml")
    assert words in str(error.value) and "\n" not in str(error.value)
