"""Tables of a solve: one row, or block of rows, for each accepted step."""

from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_csv, write_csv
from pneunet.hifi.contact.touch import KPA, MARKS, Load

STEPS = [
    *"step pressure_kPa iterations factorisations volume_mm3 tip_x_mm tip_y_mm tip_z_mm".split(),
    *["smallest_wall_distance_mm", MARKS[0], "body_distance_mm", MARKS[1], "contact_force_N"],
    *"largest_stretch unstable_directions dead_load_fraction stability_factorisations seconds".split(),
]
TABLES = {
    "steps": STEPS,
    "centrelines": [*"step pressure_kPa s_mm x_mm y_mm z_mm".split(), *MARKS],
    "segments": [*"step pressure_kPa segment e1 e2 e3 k1_rad_per_mm k2_per_mm k3_per_mm".split(), *MARKS],
}


class ResultFiles:
    """CSV files of a run, rewritten whole after every accepted step so that a kill leaves them valid. Rank 0
    only."""

    def __init__(self, directory, gaps):
        self.directory, self.gaps = Path(directory), gaps
        self.steps, self.centrelines, self.segments = [], [], []

    def keep(self, last):
        """Go on from an earlier run's files: its rows up to step `last`. InputError when they are of another
        version's making."""
        for name, columns in TABLES.items():
            header, rows = read_csv(self.directory / f"{name}.csv")
            if header != columns:
                raise InputError(
                    f"{self.directory / name}.csv: has not the columns of this version: solve without"
                    " --resume"
                )
            setattr(self, name, [row for row in rows if int(row[0]) <= last])

    def watched(self):
        """(Load, wall distance, body distance, contact force) of the steps kept, for a
        hifi.contact.touch.TouchWatch."""
        distances = "smallest_wall_distance_mm body_distance_mm".split()
        columns = ["pressure_kPa", "dead_load_fraction", *distances, "contact_force_N"]
        rows = [[float(row[STEPS.index(name)]) for name in columns] for row in self.steps]
        return [(Load(p / KPA, dead), *seen) for p, dead, *seen in rows]

    def history(self):
        """run.json's list of the steps kept."""
        return [
            {
                "step": int(row[0]),
                "pressure_kPa": float(row[1]),
                "iterations": int(row[2]),
                "factorisations": int(row[3]),
                "stability_factorisations": int(row[STEPS.index("stability_factorisations")]),
                **{name: bool(int(row[STEPS.index(name)])) for name in MARKS},
            }
            for row in self.steps
        ]

    def add(self, m):
        p = m.pressure * KPA
        tip, touch, marks = m.frames[-1, :3, 3], m.touch, [int(holds) for holds in m.touch.marks.values()]
        row = [m.step, p, m.iterations, m.factorisations, m.volume, *tip]
        row += [touch.wall_distance, marks[0], touch.body_distance, marks[1], touch.contact_force]
        row += [m.largest_stretch, m.unstable, m.dead_loads, m.stability_factorisations, m.seconds]
        self.steps.append(row)
        self.centrelines += [[m.step, p, s, *g[:3, 3], *marks] for s, g in zip(m.stations, m.frames)]
        for i, (e, k) in enumerate(zip(m.strains.e, m.strains.k), start=1):
            self.segments.append([m.step, p, i, *e, *k, *marks])
        for name, columns in TABLES.items():
            write_csv(self.directory / f"{name}.csv", columns, getattr(self, name))
        write_csv(
            self.directory / "walls.csv",
            "segment side gap gap_mm distance_mm".split(),
            [[*gap, d] for gap, d in zip(self.gaps, m.walls)],
        )


def limit_text(point):
    """A hifi.path.equilibrium.LimitPoint of the pressure in words."""
    return f"limit point: pressure {point.load * KPA:.4g} kPa ({point.kind}) at volume {point.volume:.4g} mm3"


def limit_table(point):
    """The same for run.json."""
    return {"pressure_kPa": point.load * KPA, "volume_mm3": point.volume, "kind": point.kind}
