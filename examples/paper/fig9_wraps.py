"""Fig. 9(b), (e): the designs for vase and pear, in three and two helical segments."""

from examples.paper.common import Statement
from examples.paper.designs import angles_of, designed, draw_designs, followed
from examples.paper.fig9 import DESIGNS
from pneunet.design.design import Design


def compute() -> dict[str, Design]:
    return designed(list(DESIGNS))


def statements(found: dict[str, Design]) -> list[Statement]:
    said = []
    for name, (angles, pressure) in DESIGNS.items():
        design = found[name]
        said += [
            Statement(
                f"{name}: {len(angles)} segments of {', '.join(f'{a:g}' for a in angles)} degrees at"
                f" {1e3 * pressure:g} kPa",
                f"{angles_of(design)} deg at {design.pressure_kPa:.1f} kPa, another body on another path",
                None,
            ),
            followed(name, design),
        ]
    return said


def draw(found: dict[str, Design]):
    return draw_designs(found)
