from pathlib import Path

import numpy as np
import pytest

from examples import make_targets
from pneunet.base.errors import InputError
from pneunet.design.target.file import SHIPPED, read_target

GOOD = "x_mm,y_mm,z_mm\n" + "".join(f"{10 * i},0,0\n" for i in range(6))


def csv(tmp_path, text, name="curve.csv"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def toml(tmp_path, text):
    csv(tmp_path, GOOD)
    (tmp_path / "target.toml").write_text(text)
    return tmp_path / "target.toml"


@pytest.mark.parametrize("name", sorted(make_targets.TARGETS))
def test_shipped_targets_are_what_their_numbers_say(name, tmp_path):
    make_targets.main(tmp_path, tmp_path, tmp_path / "curves")
    assert (tmp_path / f"{name}.csv").read_text() == (SHIPPED / f"{name}.csv").read_text()
    target = read_target(SHIPPED / f"{name}.toml")
    steps = np.linalg.norm(np.diff(target.points, axis=0), axis=1)
    assert len(target.points) == 201 and np.ptp(steps) < 4e-4  # even but for the fourth decimal


def test_the_octopus_with_frames_is_what_its_numbers_say(tmp_path):
    make_targets.main(tmp_path, tmp_path, tmp_path / "curves")
    shipped = Path(make_targets.__file__).parent / "curves" / "octopus.csv"
    assert (tmp_path / "curves" / "octopus.csv").read_text() == shipped.read_text()
    target = read_target(shipped)
    assert abs(target.points - read_target("octopus").points).max() < 1e-4 and len(target.frames) == 201


def test_bare_columns_and_named_ones_say_the_same(tmp_path):
    bare = csv(tmp_path, GOOD.split("\n", 1)[1], "bare.csv")
    assert np.array_equal(read_target(bare).points, read_target(csv(tmp_path, GOOD)).points)
    assert read_target(bare).name == "bare"


@pytest.mark.parametrize(
    "head, row",
    [
        ("X [mm];Y [mm];Z [mm]\n", "{0},5;1;0\n"),
        ("Take 3; 2026-11-27\n\nX;Y;Z\nm;m;m\n", "{0}e-3;1e-3;0\n"),
        ("t (s)\tPosition X (cm)\tPosition Y (cm)\tPosition Z (cm)\n", "{0}\t{0}e-1\t1e-1\t0\n"),
        ("Points:0,Points:1,Points:2\n", "{0}.0,1,0\n"),
        ("# x y z\n", "{0} 1 0\n"),
        ("", "  {0}   1   0\n"),
    ],
)
def test_what_trackers_and_cad_write(tmp_path, head, row):
    rows = [10 * i + 10 for i in range(6)]
    points = read_target(csv(tmp_path, head + "".join(row.format(x) for x in rows))).points
    assert points[:, 1:] == pytest.approx(np.array([[1, 0]] * 6))
    assert points[:, 0] == pytest.approx(np.array(rows) + 0.5 * (",5" in row))


def test_frames_by_columns(tmp_path):
    text = "x_mm,y_mm,z_mm,t1x,t1y,t1z,t2x,t2y,t2z\n" + "".join(
        f"{9 * i},0,0,1,0,0,0,0,1\n" for i in range(5)
    )
    frames = read_target(csv(tmp_path, text)).frames
    assert np.allclose(frames[2], [[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def test_toml_with_inline_points_frames_and_everything(tmp_path):
    target = read_target(toml(tmp_path, """
        name = "all"
        points_mm = [[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0]]
        frames = [
            [[1,0,0], [0,1,0], [0,0,1]], [[1,0,0], [0,1,0], [0,0,1]],
            [[1,0,0], [0,1,0], [0,0,1]], [[1,0,0], [0,1,0], [0,0,1]],
        ]
        pressure_range_kPa = [20, 40]
        base = { direction = [2, 0, 0], width_direction = [0, 0, 1] }
        material = { mu_MPa = 0.2 }
        segment = { width_mm = 14 }
        vary = { chamber_height_mm = [3, 6], angle_deg = [50, 90] }
        [[piece]]
        kind = "helical"
        length_mm = 30
        cylinder_curvature_per_m = 70
        pitch_mm = 90
    """))  # fmt: skip
    assert target.pressure_range == pytest.approx((0.02, 0.04)) and target.material.mu == 0.2
    assert np.allclose(target.base_rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert target.start == {"width": 14.0} and target.vary == {"chamber_height": (3, 6), "angle": (50, 90)}
    piece = target.pieces[0]
    assert piece.twist == pytest.approx(0.0349998, abs=1e-6) and piece.curvature == pytest.approx(
        0.0349064, abs=1e-6
    )


def test_shipped_target_by_name_with_own_keys(tmp_path):
    target = read_target(toml(tmp_path, 'target = "octopus"\npressure_range_kPa = [30, 40]\nname = "mine"'))
    assert len(target.points) == 201 and len(target.pieces) == 3 and target.name == "mine"
    assert target.pressure_range == pytest.approx((0.03, 0.04))


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "holds no rows of numbers"),
        ("x_mm,y_mm,z_mm\n0,0,0\n1,a,0\n2,0,0\n3,0,0\n", "row 3: 'a' is not a finite number under 'y_mm'"),
        ("0,0,0\n1,nan,0\n2,0,0\n3,0,0\n", "row 2: 'nan' is not a finite number under 'column 2'"),
        ("0,0,0\n10,0,0\n20,0,0\n", "3 points: a target needs at least 4"),
        ("0,0,0\n10,0,0\n10,0,0\n20,0,0\n", "points 2 and 3 are the same"),
        ("0,0\n1,1\n2,2\n3,3\n", "has 3 columns x, y, z in mm, not 2"),
        ("0,0,0\n10,0\n20,0,0\n30,0,0\n", "row 2: is empty under 'column 3'"),
        ("x_mm,y [m],z_mm\n0,0,0\n", "x in mm, y in m, z in mm: write all three in the same unit"),
        ("x_mm,x,y_mm,z_mm\n0,0,0,0\n", "two columns 'x'"),
        ("x_km,y_km,z_km\n0,0,0\n", "column 'x_mm' is missing: there are x_km, y_km, z_km"),
        ("0,0,0\n10,0,0\n10,0,0\n10,0,0\n20,0,0\n", "are the same, and 1 more such pairs"),
        ("0,0,0\n2e6,0,0\n10,0,0\n20,0,0\n", "point 2 is over 1e+06 mm away"),
        ("0,0,0\n1e300,0,0\n10,0,0\n20,0,0\n", "row 2: '1e300' is not a finite number"),
        ("x_mm,y_mm\n0,0\n", "column 'z_mm' is missing"),
        ("0,0,0\n.01,0,0\n.02,0,0\n.03,0,0\n", "are its coordinates in mm?"),
        (
            "x_mm,y_mm,z_mm,t1x,t1y,t1z\n" + "".join(f"{9 * i},0,0,1,0,0\n" for i in range(5)),
            "column 't2x' is missing",
        ),
        (
            "x_mm,y_mm,z_mm,t1x,t1y,t1z,t2x,t2y,t2z\n"
            + "".join(f"{9 * i},0,0,1,0,0,1,0,0\n" for i in range(5)),
            "orthogonal",
        ),
        (
            "x_mm,y_mm,z_mm,t1x,t1y,t1z,t2x,t2y,t2z\n"
            + "".join(f"{9 * i},0,0,0,1,0,1,0,0\n" for i in range(5)),
            "t1 does not point",
        ),
    ],
)
def test_bad_csv(tmp_path, text, words):
    path = csv(tmp_path, text)
    with pytest.raises(InputError) as error:
        read_target(path)
    assert words in str(error.value) and "curve.csv" in str(error.value) and "\n" not in str(error.value)


PIECE = '[[piece]]\nkind = "{}"\nlength_mm = 50\n{}'


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "give one of 'points'"),
        ("points = 3", "names a CSV file"),
        ('points = "missing.csv"', "missing.csv: no such file"),
        ('pints = "curve.csv"', "unknown key 'pints': did you mean 'points'"),
        ('points = "curve.csv"\npressure_MPa = 1', "has the wrong unit: write 'pressure_kPa'"),
        ('points = "curve.csv"\npressure_kPa = 90', "must lie in 0..60 kPa"),
        ('points = "curve.csv"\npressure_kPa = "high"', "must be a finite number"),
        ('points = "curve.csv"\npressure_kPa = 9\npressure_range_kPa = [1, 2]', "exclude each other"),
        ('points = "curve.csv"\npressure_range_kPa = [9, 2]', "the smallest comes first"),
        ('points = "curve.csv"\npressure_range_kPa = [0, 0]', "must lie in 0..60 kPa"),
        ('points = "curve.csv"\npressure_kPa = 0', "and not be 0"),
        ('points = ""', "'points' names a CSV file"),
        (
            "pressure_kPa = 9\n[[shape]]\npoints_mm = [[0, 0, 0]]\npressure_kPa = 9",
            "'pressure_kPa' is given at the top and in the first [[shape]]",
        ),
        ('points = "curve.csv"\nbase = 3', "[base]: must be a table of keys, not 3"),
        ('points = "curve.csv"\ncasting = []', "[casting]: must be a table of keys"),
        ("[[shape]]\npoints_mm = [[0, 0, 0]]\npresure_kPa = 9", "[[shape]] 1: unknown key 'presure_kPa'"),
        ('points_mm = [[0, 0, "a"]]', "'points_mm' must be a list of [x, y, z]"),
        ("points_mm = [[0, 0, 0], [1, 0]]", "'points_mm' must be a list of [x, y, z]"),
        ('points = "curve.csv"\nframes = [1]', "'frames' must be a list"),
        ('target = "squid"', "'squid' is not shipped: shipped are octopus, pear, tentacle2, vase"),
        ('target = "vase"\npoints = "curve.csv"', "exclude each other"),
        ('points = "curve.csv"\n[piece]\nkind = "bending"', "double brackets"),
        (
            'points = "curve.csv"\n' + PIECE.format("curly", ""),
            "write 'passive', 'twisting', 'bending' or 'helical'",
        ),
        ('points = "curve.csv"\n[[piece]]\nkind = "bending"', "key 'length_mm' is missing"),
        (
            'points = "curve.csv"\n' + PIECE.format("bending", "").replace("50", "70"),
            "add up to 70 mm but the curve is 50 mm",
        ),
        (
            'points = "curve.csv"\n' + PIECE.format("bending", "curvature_per_mm = 1"),
            "write 'curvature_per_m'",
        ),
        ('points = "curve.csv"\n' + PIECE.format("bending", "curvature_per_m = -1"), "must be larger than 0"),
        ('points = "curve.csv"\n' + PIECE.format("twisting", "tau_rad_per_m = 1"), "write 'tau_rad_per_mm'"),
        ('points = "curve.csv"\n' + PIECE.format("helical", "pitch_mm = 1"), "a helix is given by"),
        ('points = "curve.csv"\n[base]\nwidth_direction = [0, 1, 0]', "needs 'direction' too"),
        ('points = "curve.csv"\n[base]\ndirection = [0, 0, 0]', "not all 0"),
        ('points = "curve.csv"\n[base]\ndirection = [1, 0, 0]\nwidth_direction = [1, 1, 0]', "perpendicular"),
        ('points = "curve.csv"\n[segment]\nwdth_mm = 2', "did you mean 'width_mm'"),
        ('points = "curve.csv"\n[segment]\nwidth_cm = 2', "has the wrong unit: write 'width_mm'"),
        ('points = "curve.csv"\n[vary]\nwidth_mm = [2, 3]', "unknown key 'width_mm'"),
        ('points = "curve.csv"\n[vary]\nwall_mm = 2', "must be [smallest, largest]"),
        ('points = "curve.csv"\n[material]\nmu_kPa = 2', "has the wrong unit: write 'mu_MPa'"),
    ],
)
def test_bad_toml(tmp_path, text, words):
    with pytest.raises(InputError) as error:
        read_target(toml(tmp_path, text))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_missing_or_strange_files(tmp_path):
    for name in ("none.csv", "none.toml", "none.txt"):
        with pytest.raises(InputError, match="no such file"):
            read_target(tmp_path / name)
    (tmp_path / "a.txt").write_text("hello")
    with pytest.raises(InputError, match="holds no rows of numbers"):
        read_target(Path(tmp_path / "a.txt"))
