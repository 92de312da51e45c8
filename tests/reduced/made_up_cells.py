"""Made-up cells: a smooth law that obeys the symmetries, in the schema of the data set."""

import numpy as np

from pneunet.base.files.dataset import UPPER, CellData, columns
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import MIRROR
from pneunet.geometry.parameters import KINDS, ONE_SIDED
from pneunet.geometry.shape_numbers import SHAPE, STIFFENING, direction_matrix, segment_of
from pneunet.reduced.trained.coordinates import BLOCKS, REST
from pneunet.reduced.trained.enthalpy import whitening

SLOPES = {f.name: f.metadata["shape"] for f in columns() if f.name.endswith("_slopes")}
DESIGNS, PRESSURES = 60, np.linspace(0, 0.3, 5)
#: names and largest elements; how much softer cells are on ever finer grids, by the logarithm
GRIDS = ("coarse", 2.0), ("fine", 1.5), ("finest", 1.0)
SOFTER = 0.05


def true_free(kind, numbers, P, softer=0.0):
    """(6,) free strains, by so much larger."""
    c, width = np.cos(np.radians(numbers[0])), numbers[SHAPE.index("width")]
    wall = numbers[SHAPE.index("wall")]
    size = P * np.exp(0.4 * np.log(width) - np.log(wall) + 0.8 * c**2 + 0.5 * P + softer)
    size *= np.exp(-(2 * numbers[13] + 10 * numbers[14]) * P)
    if kind == ONE_SIDED:
        return REST + size * np.array([0.2 + 0.1 * c**2, -0.2 * c, 0, c * (1 + P), 1, 0])
    return REST + size * np.array([1, 0, 0, 2 * c / width, 0, 0])


def true_stiffness(kind, numbers, P, softer=0.0):
    """(6, 6) of the free state."""
    c, K = np.cos(np.radians(numbers[0])), np.zeros((6, 6))
    for block in BLOCKS[kind]:
        L = np.eye(len(block))
        for i in range(len(block)):
            for j in range(i):
                odd = MIRROR[block[i]] * MIRROR[block[j]] < 0
                L[i, j] = (0.3 * c if odd else 0.2) * (1 + P) / (1 + i)
        stiff = 0.5 * np.log(numbers[SHAPE.index("wall")]) + P + numbers[13] - softer
        D = np.exp(stiff) / (1.0 + np.array(block))
        K[np.ix_(block, block)] = L @ np.diag(D) @ L.T
    return K


def true_stretch(numbers, lead):
    return 1 + lead * numbers[SHAPE.index("width")] ** 0.3


def softer(numbers, grid):
    """How much softer, by the logarithm, a cell is on a grid than on the coarse one; 3 stands for ever finer
    ones. Layers of the last two differ by a factor of two, and their errors by 2**1.1."""
    whole = SOFTER * (1 + 0.3 * np.cos(np.radians(numbers[0])) ** 2)
    left = 0.3 / 1.3
    return whole * [0.0, 1 - left, 1 - left / 2**1.1, 1.0][grid]


def made_up_data(designs=DESIGNS, grids=1):
    """CellData on the first of GRIDS: all designs on the coarse one, half of them on the second, a sixth on
    the third."""
    rng = np.random.default_rng(4)
    rows = {f.name: [] for f in columns()}
    for number, kind in enumerate(KINDS):
        for design in range(designs):
            numbers = made_up_numbers(kind, rng)
            for grid in range(grids):
                if design % (1, 2, 6)[grid]:
                    continue
                case = {"kind": number, "design": design, "held_out": design % 5 == 4, "mesh": grid}
                case |= {"shape": numbers[:13], "stiffening": numbers[13:]}
                case |= {"limit_pressure": np.nan, "first_touch": np.nan}
                for f in columns():
                    if f.metadata["of"] == "cases":
                        rows[f.name].append(case.get(f.name, 0))
                add_states(rows, kind, numbers, softer(numbers, grid), rng if grid == 0 else None)
    about = {
        "kinds": list(KINDS),
        "meshes": [{"name": name, "mesh_size_mm": size} for name, size in GRIDS[:grids]],
        "shape": list(SHAPE),
        "stiffening": list(STIFFENING),
        "statuses": ["done"],
    }
    about["directions"] = {kind: direction_matrix(kind).tolist() for kind in KINDS}
    about |= {"largest_symmetry_defect": 0.01, "revisions": ["made up"], "reasons": {}, "campaign": {}}
    about["ranges"] = {}
    return CellData(about, **{f.name: np.array(rows[f.name], f.metadata["type"]) for f in columns()})


def made_up_numbers(kind, rng):
    """(15,)"""
    v = rng.uniform(
        [45, 1.5, 0.6, 0.25, 0.15, 0.12, 0.3, 0.3, 0.25], [90, 2.5, 1.2, 0.4, 0.25, 0.25, 0.6, 0.6, 0.35]
    )
    shape = dict(zip(("angle", "width", "chamber_height", "cavity_thickness", "wall", "top_wall"), v))
    shape |= {"base_thickness": v[6], "channel_width": v[7], "channel_height": v[8]}
    shape["gap"] = 1 - shape["cavity_thickness"] - 2 * shape["wall"]
    shape["side_wall"] = shape["roof"] = shape["top_wall"]
    shape["cavity_floor"] = shape["channel_height"] / 2 * (1 if kind == ONE_SIDED else rng.uniform(0.3, 1))
    stiffening = rng.uniform(0, 0.13), max(rng.uniform(-0.008, 0.008), 0.0)
    return np.array([*(shape[name] for name in SHAPE), *stiffening])


def add_states(rows, kind, numbers, softer, rng):
    """Free states, and with a generator of random numbers prescribed ones."""
    row = len(rows["kind"]) - 1
    for P in PRESSURES:
        free, K = true_free(kind, numbers, P, softer), true_stiffness(kind, numbers, P, softer)
        add_state(rows, row, P, free, np.zeros(6), K, False)
    for P, doubled in zip(PRESSURES[[1, 2, 4]] if rng else (), (True, False, False)):
        K, free = true_stiffness(kind, numbers, P, softer), true_free(kind, numbers, P, softer)
        change = free - REST if doubled else rng.normal(size=6) * 0.1
        M, D1 = whitening(kind, K[None])
        v = M[0] @ change
        force = D1[0] * M[0].T @ (v + 4 * 0.7 * (v @ v) * v)  # 0.7 |v|^4: a sum of allowed monomials
        add_state(rows, row, P, free + change, force, K, True)


def add_state(rows, row, P, strains, forces, K, prescribed):
    state = {
        "case": row,
        "prescribed": prescribed,
        "pressure": P,
        "strains": strains,
        "forces": forces,
        "stiffness": K[UPPER],
        "volume": rows["shape"][row][SHAPE.index("width")] * (1 + P),
    }
    numbers = np.append(rows["shape"][row], rows["stiffening"][row])
    lead = strains[4] if KINDS[rows["kind"][row]] == ONE_SIDED else strains[0] - 1
    state["largest_stretch"] = true_stretch(numbers, lead)
    state |= {name: np.full(SLOPES[name], np.nan) for name in SLOPES}
    state["wall_distance"] = rows["shape"][row][SHAPE.index("gap")] * (1 - P)
    for f in columns():
        if f.metadata["of"] == "states":
            rows[f.name].append(state.get(f.name, 0))


def design(kind, angle=63.0, material=None, pitch=4.0):
    shape = np.array([angle, 2.0, 0.9, 0.33, 0.2, 0.27, 0.18, 0.18, 0.45, 0.18, 0.45, 0.3, 0.15])
    return segment_of(kind, shape, pitch, material or NeoHookean(mu=0.25))
