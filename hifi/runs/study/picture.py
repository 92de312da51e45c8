"""study.png: twist and curvatures of every case over the pressure."""

from pathlib import Path

import numpy as np

from pneunet.base.pictures.rendering import figure, save
from pneunet.hifi.contact.touch import marked
from pneunet.hifi.runs.case_process import DONE
from pneunet.hifi.runs.study.file import Study, value_of
from pneunet.hifi.runs.study.study import StudyTable

PANELS = (
    ("k_norm_per_mm", "|k| (1/m)"),
    ("k1_rad_per_mm", "twist k1 (rad/m)"),
    ("k2_per_mm", "curvature k2 (1/m)"),
)
PER_M = 1e3
#: more values than this are told by a colour bar instead of a legend
LEGEND_LIMIT = 12
STYLES = ("-", "--", ":", "-.")
#: levels that are marked
OVERLAP = {
    "linestyle": "",
    "marker": "o",
    "markersize": 7,
    "markerfacecolor": "none",
    "markeredgecolor": "#c92a2a",
}
MARKERS = ("", "o", "s", "^")


def draw(study: Study, table: StudyTable, path: str | Path) -> bool:
    """Draw the levels of a StudyTable to `path`: colour tells the first variable, line and marker the others.
    False: no levels."""
    cases = [(case, *known) for case in study.cases if (known := table.of(case)) and known[1]]
    if not cases:
        return False
    prefixes = [name[: -len(PANELS[0][0])] for name in cases[0][2][0] if name.endswith(PANELS[0][0])]
    sheet = figure(13, 0.8 + 3.9 * len(prefixes), "constrained")
    axes = sheet.subplots(len(prefixes), len(PANELS), squeeze=False, sharex=True)
    some_overlap = False
    looks = _Looks(study, [case for case, _, _ in cases])
    for row, prefix in zip(axes, prefixes):
        for ax, (column, label) in zip(row, PANELS):
            for case, record, levels in cases:
                x, y = (
                    np.array([float(level[name]) for level in levels])
                    for name in ("pressure_kPa", prefix + column)
                )
                ax.plot(x, PER_M * y, **looks.of(case))
                overlapping = [marked(level) for level in levels]
                ax.plot(x[overlapping], PER_M * y[overlapping], **OVERLAP)
                some_overlap |= any(overlapping)
                if record["status"] != DONE:
                    ax.plot(x[-1:], PER_M * y[-1:], "x", color="black", markersize=8, zorder=3)
            ax.set_xlabel("pressure (kPa)")
            ax.set_ylabel(label)
            ax.set_title(prefix.strip("_"), fontsize=10)
            ax.axhline(0, color="0.8", linewidth=0.8, zorder=0)
            ax.spines[["top", "right"]].set_visible(False)
    looks.explain(sheet, axes, any(record["status"] != DONE for _, record, _ in cases), some_overlap)
    save(sheet, path)
    return True


class _Looks:
    """Colour, line style and marker of each case, and the legend that tells them."""

    def __init__(self, study, cases):
        self.variable, *self.others = study.variables or ("",)  # of one body as it is nothing varies
        self.values = _in_order([_value(self.variable, case) for case in cases])
        self.combinations = _in_order([self._combination(case) for case in cases])
        self.numeric = all(isinstance(value, (int, float)) for value in self.values)

    def _combination(self, case):
        return tuple(_value(name, case) for name in self.others)

    def _colour(self, value):
        from matplotlib import colormaps

        if self.numeric and len(self.values) > 1:
            low, high = min(self.values), max(self.values)
            return colormaps["viridis"](0.92 * (value - low) / (high - low))
        return f"C{self.values.index(value) % 10}"

    def _line(self, number):
        return {
            "linestyle": STYLES[number % len(STYLES)],
            "marker": MARKERS[number // len(STYLES) % len(MARKERS)],
            "markersize": 4,
        }

    def of(self, case):
        number = self.combinations.index(self._combination(case))
        return {"color": self._colour(_value(self.variable, case)), **self._line(number)}

    def explain(self, figure, axes, some_stopped, some_overlap):
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LinearSegmentedColormap, Normalize
        from matplotlib.lines import Line2D

        handles = []
        if self.numeric and len(self.values) > LEGEND_LIMIT:
            low, high = min(self.values), max(self.values)
            colours = LinearSegmentedColormap.from_list(
                "values", [self._colour(v) for v in np.linspace(low, high, 64)]
            )
            quantity, unit = _split(self.variable)
            label = f"{quantity} ({unit})" if unit else quantity
            figure.colorbar(
                ScalarMappable(Normalize(low, high), colours), ax=axes, label=label, fraction=0.02
            )
        else:
            handles += [
                Line2D([], [], color=self._colour(v), label=_told(self.variable, v))
                for v in self.values
                if self.variable
            ]
        if len(self.combinations) > 1:
            for number, combination in enumerate(self.combinations[: len(STYLES) * len(MARKERS)]):
                label = ", ".join(_told(name, value) for name, value in zip(self.others, combination))
                handles.append(Line2D([], [], color="0.3", label=label, **self._line(number)))
        if some_stopped:
            handles.append(
                Line2D([], [], color="black", marker="x", linestyle="", label="ended before its top pressure")
            )
        if some_overlap:
            handles.append(Line2D([], [], label="overlap (no contact model)", **OVERLAP))
        figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=9)


def _value(name, case):
    """value_of, lists as tuples."""
    value = value_of(name, case)
    return tuple(value) if isinstance(value, list) else value


def _in_order(values):
    """Distinct values, sorted where they are numbers."""
    distinct = list(dict.fromkeys(values))
    return sorted(distinct) if all(isinstance(value, (int, float)) for value in distinct) else distinct


def _split(name):
    """('wall', 'mm') of 'wall_mm'; the unit is empty where there is none."""
    quantity, _, unit = name.rpartition("_")
    if unit not in ("mm", "deg", "MPa", "kPa", "percent"):
        quantity, unit = name, ""
    return quantity.replace("_", " "), unit


def _told(name, value):
    """'wall 1.2 mm', and a silicone by its name alone."""
    quantity, unit = _split(name)
    if isinstance(value, tuple):
        value = ", ".join(f"{each:g}" if isinstance(each, float) else str(each) for each in value)
    value = f"{value:g}" if isinstance(value, float) else str(value)
    return value if name == "silicone" else f"{quantity} {value} {unit}".strip()
