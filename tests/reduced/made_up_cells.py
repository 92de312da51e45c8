"""Made-up cells: a smooth law that obeys the symmetries, in the schema of the data set."""

import numpy as np

from pneunet.base.files.dataset import UPPER, CellData, columns
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import MIRROR
from pneunet.geometry.parameters import KINDS, ONE_SIDED
from pneunet.geometry.shape_numbers import SHAPE, direction_matrix, segment_of
from pneunet.reduced.trained.coordinates import BLOCKS, REST
from pneunet.reduced.trained.enthalpy import whitening

SLOPES = {f.name: f.metadata["shape"] for f in columns() if f.name.endswith("_slopes")}
DESIGNS, PRESSURES = 60, np.linspace(0, 0.3, 5)


def true_free(kind, shape, P):
    """(6,) free strains."""
    c, width, wall = np.cos(np.radians(shape[0])), shape[SHAPE.index("width")], shape[SHAPE.index("wall")]
    size = P * np.exp(0.4 * np.log(width) - np.log(wall) + 0.8 * c**2 + 0.5 * P)
    if kind == ONE_SIDED:
        return REST + size * np.array([0.2 + 0.1 * c**2, -0.2 * c, 0, c * (1 + P), 1, 0])
    return REST + size * np.array([1, 0, 0, 2 * c / width, 0, 0])


def true_stiffness(kind, shape, P):
    """(6, 6) of the free state."""
    c, K = np.cos(np.radians(shape[0])), np.zeros((6, 6))
    for block in BLOCKS[kind]:
        L = np.eye(len(block))
        for i in range(len(block)):
            for j in range(i):
                odd = MIRROR[block[i]] * MIRROR[block[j]] < 0
                L[i, j] = (0.3 * c if odd else 0.2) * (1 + P) / (1 + i)
        D = np.exp(0.5 * np.log(shape[SHAPE.index("wall")]) + P) / (1.0 + np.array(block))
        K[np.ix_(block, block)] = L @ np.diag(D) @ L.T
    return K


def made_up_data(designs=DESIGNS):
    rng = np.random.default_rng(4)
    rows = {f.name: [] for f in columns()}
    for number, kind in enumerate(KINDS):
        for design in range(designs):
            v = rng.uniform(
                [45, 1.5, 0.6, 0.25, 0.15, 0.12, 0.3, 0.3, 0.25],
                [90, 2.5, 1.2, 0.4, 0.25, 0.25, 0.6, 0.6, 0.35],
            )
            shape = dict(zip(("angle", "width", "chamber_height", "cavity_thickness", "wall", "top_wall"), v))
            shape |= {"base_thickness": v[6], "channel_width": v[7], "channel_height": v[8]}
            shape["gap"] = 1 - shape["cavity_thickness"] - 2 * shape["wall"]
            shape["side_wall"] = shape["roof"] = shape["top_wall"]
            shape["cavity_floor"] = (
                shape["channel_height"] / 2 * (1 if kind == ONE_SIDED else rng.uniform(0.3, 1))
            )
            s = np.array([shape[name] for name in SHAPE])
            case = {
                "kind": number,
                "design": design,
                "held_out": design % 5 == 4,
                "shape": s,
                "limit_pressure": np.nan,
            }
            case["first_touch"] = np.nan
            for f in columns():
                if f.metadata["of"] == "cases":
                    rows[f.name].append(case.get(f.name, 0))
            row = len(rows["kind"]) - 1
            for P in PRESSURES:
                add_state(rows, row, P, true_free(kind, s, P), np.zeros(6), true_stiffness(kind, s, P), False)
            for P, doubled in zip(PRESSURES[[1, 2, 4]], (True, False, False)):
                K, free = true_stiffness(kind, s, P), true_free(kind, s, P)
                change = free - REST if doubled else rng.normal(size=6) * 0.1
                M, D1 = whitening(kind, K[None])
                v = M[0] @ change
                force = D1[0] * M[0].T @ (v + 4 * 0.7 * (v @ v) * v)  # 0.7 |v|^4: a sum of allowed monomials
                add_state(rows, row, P, free + change, force, K, True)
    about = {
        "kinds": list(KINDS),
        "meshes": [{"name": "a", "mesh_size_mm": 1}],
        "shape": list(SHAPE),
        "statuses": ["done"],
    }
    about["directions"] = {kind: direction_matrix(kind).tolist() for kind in KINDS}
    about |= {"largest_symmetry_defect": 0.01, "revisions": ["made up"], "reasons": {}}
    return CellData(about, **{f.name: np.array(rows[f.name], f.metadata["type"]) for f in columns()})


def add_state(rows, row, P, strains, forces, K, prescribed):
    state = {
        "case": row,
        "prescribed": prescribed,
        "pressure": P,
        "strains": strains,
        "forces": forces,
        "stiffness": K[UPPER],
    }
    state |= {name: np.full(SLOPES[name], np.nan) for name in SLOPES}
    state["wall_distance"] = rows["shape"][row][SHAPE.index("gap")] * (1 - P)
    for f in columns():
        if f.metadata["of"] == "states":
            rows[f.name].append(state.get(f.name, 0))


def design(kind, angle=63.0, material=None, pitch=4.0):
    shape = np.array([angle, 2.0, 0.9, 0.33, 0.2, 0.27, 0.18, 0.18, 0.45, 0.18, 0.45, 0.3, 0.15])
    return segment_of(kind, shape, pitch, material or NeoHookean(mu=0.25))
