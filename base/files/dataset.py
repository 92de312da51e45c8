"""The data set of unit cells that the rod law is trained on: its schema, in and out of one compressed file.

Written by `pneunet campaign` (finite elements), read by `pneunet train`: the two meet here and nowhere else.
All numbers are without dimension. With l the normal pitch (thickness of a chamber and a gap, across the
chamber) and mu = 2 c10 the shear modulus of Yeoh's material, and everything per undeformed length of the
segment:
    pressure P/mu, strains q = (e, k l), forces dpsi/dq = (force/(mu l^2), moment/(mu l^3)), stiffness
    d2psi/dq2, volume V/l^2, energy W/(mu l^2)
Derivatives by shape and material are along about['directions'], by kind: changes of the shape numbers
(degrees, normal pitches) and of the stiffening. One row a *case* (a design on a mesh) and one row a *state*
(an equilibrium of a case).
"""

from dataclasses import Field, dataclass, field, fields
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.archive import Member, read_archive, write_archive

SCHEMA = "pneunet-cells-3"
FIX = "make it again with pneunet campaign"
#: keys of `about` that are read again, and their types
KEYS = {
    **dict.fromkeys(("kinds", "meshes", "shape", "statuses", "revisions"), list),
    **dict.fromkeys(("directions", "reasons", "campaign", "ranges"), dict),
    "largest_symmetry_defect": float,
}
#: row-wise upper triangle of a symmetric 6 x 6 matrix
UPPER = np.triu_indices(6)
#: directions that a kind may have at most; rows beyond its own are nan
DIRECTIONS = 12
#: of the 23 bits of a slope's mantissa, those that are kept: to 1e-4 of itself, a hundredth of what a mesh
#: changes (a seventh off the file)
SLOPE_BITS = 12
#: kind -> strains (of e1 e2 e3 k1 k2 k3) that must vanish when free: a one-sided cell maps to itself under a
#: half turn about z, a twisting one under those about x, y and z
FORBIDDEN = {"one-sided": [2, 5], "twisting": [1, 2, 4, 5]}


def column(
    of: str, shape: tuple[int, ...], kind: str, note: str, gaps: bool = False, index_of: str = ""
) -> Any:
    """One array of the data set: rows are cases or states; further shape; numpy type on disk; whether nan may
    stand in it; what it is an index into: a list of `about`, or "cases"."""
    return field(
        metadata={"of": of, "shape": shape, "type": kind, "note": note, "gaps": gaps, "index_of": index_of}
    )


@dataclass(frozen=True)
class CellData:
    """The arrays, first axis cases (n) or states (m). `about` is a dict: kinds, meshes, shape (names),
    directions, reasons, campaign, ..."""

    about: dict
    # ---- cases
    kind: np.ndarray = column("cases", (), "i1", "index into about['kinds']", index_of="kinds")
    design: np.ndarray = column(
        "cases", (), "i4", "number in the sample of its kind, from 0; edge designs from 100000"
    )
    held_out: np.ndarray = column("cases", (), "?", "for judging only")
    mesh: np.ndarray = column("cases", (), "i1", "index into about['meshes']", index_of="meshes")
    shape: np.ndarray = column(
        "cases", (13,), "f4", "about['shape']: angle in degrees, lengths in normal pitches"
    )
    stiffening: np.ndarray = column(
        "cases", (2,), "f4", "about['stiffening']: c20/c10 and c30/c10 of Yeoh's law"
    )
    normal_pitch_mm: np.ndarray = column("cases", (), "f4", "as sampled; everything else is divided by it")
    status: np.ndarray = column("cases", (), "i1", "index into about['statuses']", index_of="statuses")
    limit_pressure: np.ndarray = column(
        "cases", (), "f4", "P/mu of the limit load or of the path's end; nan: not met", gaps=True
    )
    first_touch: np.ndarray = column(
        "cases", (), "f4", "P/mu at which walls touch; nan: not met or not looked for", gaps=True
    )
    cells: np.ndarray = column("cases", (), "i4", "elements")
    unknowns: np.ndarray = column("cases", (), "i4", "of the cell")
    seconds: np.ndarray = column("cases", (), "f4", "of CPU that the case took")
    missing: np.ndarray = column("cases", (), "i1", "prescribed states that were not reached")
    # ---- states
    case: np.ndarray = column("states", (), "i4", "row of its case", index_of="cases")
    prescribed: np.ndarray = column("states", (), "?", "at prescribed strains; else free")
    pressure: np.ndarray = column("states", (), "f4", "P/mu")
    strains: np.ndarray = column("states", (6,), "f4", "e1 e2 e3, and k1 k2 k3 times l")
    forces: np.ndarray = column("states", (6,), "f4", "conjugate to the strains")
    stiffness: np.ndarray = column("states", (21,), "f4", "upper triangle, row by row")
    volume: np.ndarray = column("states", (), "f4", "of the air per length")
    energy: np.ndarray = column("states", (), "f4", "stored, per length")
    unstable: np.ndarray = column("states", (), "i1", "unstable directions, free strains included")
    largest_stretch: np.ndarray = column(
        "states",
        (),
        "f4",
        "principal stretch, mean over the most stretched 1 % of the solid; nan: unknown",
        True,
    )
    residual: np.ndarray = column("states", (), "f4", "norm over mu pitch^2")
    wall_distance: np.ndarray = column(
        "states", (), "f4", "smallest of neighbouring chambers over l; nan: not measured", gaps=True
    )
    contact: np.ndarray = column("states", (), "?", "computed with contact")
    strain_slopes: np.ndarray = column(
        "states", (DIRECTIONS, 6), "f4", "of free strains along the directions; nan: not computed", gaps=True
    )
    stiffness_slopes: np.ndarray = column(
        "states", (DIRECTIONS, 21), "f4", "of the stiffness of free states, likewise", gaps=True
    )

    def __post_init__(self):
        rows = {"cases": len(self.kind), "states": len(self.case)}
        for f in columns():
            value = np.asarray(getattr(self, f.name))
            wanted = (rows[f.metadata["of"]], *f.metadata["shape"])
            if value.shape != wanted:
                raise InputError(f"data set: '{f.name}' has shape {value.shape}, not {wanted}")
            object.__setattr__(self, f.name, value)

    @property
    def matrices(self) -> np.ndarray:
        """(m, 6, 6) stiffness."""
        return full_matrices(self.stiffness)

    @property
    def overlapping(self) -> np.ndarray:
        """(m,) bool: walls have passed through one another, without contact: no state of a real cell."""
        return (self.wall_distance < 0) & ~self.contact

    @property
    def accepted(self) -> np.ndarray:
        """(n,) bool: the path came to its top pressure, stable all the way, and kept the symmetry of the
        body."""
        done = self.status == self.about["statuses"].index("done")
        bad = np.bincount(self.case, ~self.prescribed & (self.unstable > 0), len(self.kind)) > 0
        return done & ~bad & (self.symmetry_defect <= self.about["largest_symmetry_defect"])

    @property
    def symmetry_defect(self) -> np.ndarray:
        """(n,) norm of the strains that the body's half turns forbid over that of all (rest taken off), at
        the top pressure; nan: none.

        Over k alone it would blow up in a twisting segment near 90 degrees, which hardly turns.
        """
        out = np.full(len(self.kind), np.nan)
        free = np.flatnonzero(~self.prescribed)
        last = dict(zip(self.case[free].tolist(), free.tolist()))
        for row, where in last.items():
            q = self.strains[where] - np.eye(6)[0]
            forbidden = FORBIDDEN[self.about["kinds"][self.kind[row]]]
            out[row] = np.linalg.norm(q[forbidden]) / max(float(np.linalg.norm(q)), 1e-12)
        return out

    def energy_defect(self) -> np.ndarray:
        """(n,) difference of stored energy and work of the pressure along the free states, over that work;
        nan: too few states.

        The work is the integral of P over V by a cubic spline through the states, whose error is part of the
        difference.
        """
        from scipy.interpolate import CubicSpline

        out = np.full(len(self.kind), np.nan)
        for row in range(len(self.kind)):
            i = np.flatnonzero((self.case == row) & ~self.prescribed)
            if len(i) < 4:
                continue
            P, V, W = (getattr(self, n)[i].astype(float) for n in ("pressure", "volume", "energy"))
            work = CubicSpline(V, P).integrate(V[0], V[-1]) if (np.diff(V) > 0).all() else np.nan
            out[row] = abs(W[-1] - W[0] - work) / work
        return out


def full_matrices(upper: np.ndarray) -> np.ndarray:
    """(..., 6, 6) symmetric matrices of their upper triangles (..., 21)."""
    full = np.zeros((*upper.shape[:-1], 6, 6))
    full[..., UPPER[0], UPPER[1]] = full[..., UPPER[1], UPPER[0]] = upper
    return full


def columns() -> list[Field]:
    """The dataclass fields of CellData that are arrays."""
    return [f for f in fields(CellData) if "of" in f.metadata]


def write_dataset(path: str | Path, data: CellData) -> None:
    """Write CellData to `path` (.npz); slopes are rounded to SLOPE_BITS."""
    arrays = {f.name: np.asarray(getattr(data, f.name)).astype(f.metadata["type"]) for f in columns()}
    arrays |= {
        name: _rounded(values, SLOPE_BITS) for name, values in arrays.items() if name.endswith("_slopes")
    }
    write_archive(path, SCHEMA, data.about, arrays, compress=True)


def _rounded(values, bits):
    """float32 values of which the last bits are 0: numbers that compress."""
    step = 1 << (23 - bits)
    kept = (values.view(np.uint32) + np.uint32(step // 2)) & np.uint32(~(step - 1) & 0xFFFFFFFF)
    return np.where(np.isfinite(values), kept.view(np.float32), values)


def read_dataset(path: str | Path) -> CellData:
    """The CellData in a file; InputError when it is none or of another version."""
    about, arrays = read_archive(path, SCHEMA, "a data set of cells", FIX, KEYS, _members)
    return CellData(about, **arrays)


def _members(about, _):
    """What the file holds: every column of CellData."""
    _require_lists(about)
    members = {}
    for f in columns():
        kind = {"i": "iu", "f": "f", "?": "b"}[f.metadata["type"][0]]
        of, index_of = f.metadata["of"], f.metadata["index_of"]
        form, gaps = (of, *f.metadata["shape"]), f.metadata["gaps"]
        members[f.name] = Member(kind, form, gaps=gaps)
        if index_of:
            below = len(about[index_of]) if index_of in about else index_of
            members[f.name] = Member(kind, form, 0, below, gaps)
    return members


def _require_lists(about):
    """InputError for what stands in `about` under the right keys and is no such thing."""
    lists = ("shape", "stiffening", "statuses", "revisions")
    wrong: list[Any] = [key for key in lists if not isinstance(about.get(key), list)]
    words = [word for key in lists if key not in wrong for word in about[key]]
    kinds = [kind for kind in FORBIDDEN if kind in about["kinds"]]
    wrong += [kind for kind in about["kinds"] if kind not in kinds]
    wrong += [mesh for mesh in about["meshes"] if not _is_mesh(mesh)]
    wrong += [] if "done" in about["statuses"] else ["statuses"]
    wrong += [word for word in words if not isinstance(word, str)]
    wrong += [kind for kind in kinds if not _is_matrix(about["directions"].get(kind, []), about)]
    wrong += [] if isinstance(about["campaign"].get("designs", 0), int) else ["designs"]
    if wrong:
        raise InputError(f"member 'about': {str(wrong[0])[:80]!r} is not understood: {FIX}")


def _is_mesh(mesh):
    """Whether it has a name, and sizes that are numbers."""
    if not isinstance(mesh, dict) or "mesh_size_mm" not in mesh or not isinstance(mesh.get("name"), str):
        return False
    return all(isinstance(value, Real) for key, value in mesh.items() if key.endswith("_mm"))


def _is_matrix(rows, about):
    try:
        numbers = len(about["shape"]) + len(about["stiffening"])
        return np.array(rows, float).reshape(-1, numbers).shape[0] <= DIRECTIONS
    except (TypeError, ValueError, KeyError):
        return False
