"""The workshop pack: its files, its amounts against the CAD's volume, its limits against their own laws."""

import json
from dataclasses import replace

import numpy as np
import pytest

import pneunet as pn
from pneunet.base.materials.laws import PAPER_TWISTING, NeoHookean
from pneunet.cli import main
from pneunet.design.workshop.limits import limits
from pneunet.design.workshop.sensitivity import sensitive
from pneunet.design.workshop.sheet import Pack, amounts, sections
from pneunet.geometry.cad import body as cad
from pneunet.geometry.designfile import DesignFile, write_design_file
from pneunet.geometry.moulds.layers import runs
from pneunet.geometry.moulds.parameters import Moulds
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced.rod.clearance import gap_left, wall_bulge, wall_stretch
from tests.design.toy_law import ToyLaw

SILICONE = pn.silicone("Ecoflex 00-30")
FINGER = Segment("one-sided", 90.0, 2, material=SILICONE)
TWO = Manipulator((FINGER, Segment("twisting", 60.0, 1, group=2, material=SILICONE)))


def test_the_pack(tmp_path, capsys):
    write_design_file(tmp_path / "design.toml", DesignFile(TWO, (0.004, 0.002), name="two"))
    (tmp_path / "moulds.toml").write_text("shrinkage_percent = 0\nwaste_percent = 10\n")
    command = ["export", str(tmp_path / "design.toml"), "--moulds", str(tmp_path / "moulds.toml")]
    assert main(command) == 0
    folder = tmp_path / "workshop"
    pack = json.loads((folder / "pack.json").read_text())
    names = {part["name"] for part in pack["parts"]}
    assert {"body", "upper-tray", "upper-plate", "lower-tray", "lower-plate", "middle-frame", "jig"} <= names
    for name in names - {"body"}:
        assert (folder / "moulds" / f"{name}.stl").stat().st_size > 84
        assert (folder / "moulds" / f"{name}.step").read_text().startswith("ISO-10303-21")
    assert {"body.stl", "body.step", "moulds.png", "drawing.png"} <= {p.name for p in folder.iterdir()}
    assert (folder / "sheet.pdf").read_bytes().startswith(b"%PDF")
    with cad.session():
        volume = cad.build(TWO)["body_mm3"]
    grams = sum(pour["g"] * pour["casts"] for pour in pack["pours"])
    assert grams == pytest.approx(1.1 * volume * SILICONE.density * 1e6, abs=0.005)
    sheet = (folder / "sheet.html").read_text()
    told = f"In all: {grams:.1f} g of Ecoflex 00-30", "2 pressure groups", "vouches no further", "upper-plate"
    assert all(text in sheet for text in told)
    # a second pack takes the place of the first
    (folder / "moulds" / "old-tray.stl").touch()
    (tmp_path / "moulds.toml").write_text("bed_width_mm = 20\n")
    capsys.readouterr()
    assert main(command) == 2 and "bed_width_mm = 20: 'upper-tray' needs" in capsys.readouterr().err
    assert (folder / "moulds" / "old-tray.stl").exists()  # nothing is touched by what is refused
    (tmp_path / "moulds.toml").write_text("draft_mm = 1\n")
    assert main(command) == 2 and "write 'draft_deg'" in capsys.readouterr().err


def test_limits_are_where_the_estimates_say():
    weak = replace(SILICONE, elongation_at_break=0.1)
    body = Manipulator(tuple(replace(s, material=weak) for s in TWO.segments))
    design = DesignFile(body, (0.004, 0.002))
    found = limits(design, ToyLaw(limit=0.0061))
    assert [limit.pressure for limit in found] == sorted(limit.pressure for limit in found)
    touch = next(limit for limit in found if "touch" in limit.reason)
    left = [gap_left(s, p) for s, p in zip(body.segments, body.pressures(design.scaled(touch.pressure)))]
    assert min(left) == pytest.approx(0, abs=1e-3)
    tears = next(limit for limit in found if "elongation at break" in limit.reason)
    stretches = map(wall_stretch, body.segments, body.pressures(design.scaled(tears.pressure)))
    assert max(stretches) == pytest.approx(1.05, abs=1e-3)
    gives_way = next(limit for limit in found if "no equilibrium" in limit.reason)
    assert gives_way.pressure == pytest.approx(0.0061, abs=0.00005)


def test_a_bulging_wall_stretches_as_an_arc():
    """A wall that bulges by half its height is half a circle: pi / 2."""
    from scipy.optimize import brentq

    half = min(FINGER.chamber_height, FINGER.cavity_width) / 2
    pressure = brentq(lambda p: wall_bulge(FINGER, p) - half, 1e-6, 100)
    assert wall_stretch(FINGER, pressure) == pytest.approx(np.pi / 2)
    assert wall_stretch(FINGER, 0.0) == 1.0


def test_what_matters_most_comes_first():
    effects = sensitive(DesignFile(TWO, (0.004, 0.002)), ToyLaw())
    sizes = [e.rms for e in effects]
    assert 3 <= len(effects) <= 8 and sizes == sorted(sizes, reverse=True) and sizes[0] > 0


def test_silicones_without_names_are_mixed_apart():
    soft, stiff = NeoHookean(mu=0.1), NeoHookean(mu=1.0, density=2e-9)
    layered = replace(FINGER, material=soft, layer_thickness=0.5, layer_material=stiff)
    body, moulds = Manipulator((layered,)), Moulds(shrinkage=0.0, waste=0.0)
    pours = amounts(Pack(DesignFile(body, 0.02), moulds, (), runs(body), (), ()))
    grams = {name: sum(gram for _, of, _, gram, _ in pours if of == name) for _, name, *_ in pours}
    assert list(grams) == ["silicone, mu = 0.1 MPa", "silicone, mu = 1 MPa"]
    layer = layered.length * layered.width * 0.5 * stiff.density * 1e6
    assert grams["silicone, mu = 1 MPa"] == pytest.approx(layer)


def test_the_sheet_says_which_silicone_was_assumed():
    body = Manipulator((replace(FINGER, material=PAPER_TWISTING),))
    pack = Pack(DesignFile(body, 0.02), Moulds(), (), (), (), ())
    assert dict(sections(pack))["Mix"][0].startswith("ASSUMED silicone, where nobody gave another: paper, ")
    known = Manipulator((replace(body.segments[0], material=SILICONE),))
    assert "ASSUMED" not in str(dict(sections(replace(pack, design=DesignFile(known, 0.02))))["Mix"])
