"""`pneunet export`: everything to cast a design: body and moulds as STEP and STL, a sheet, a picture."""

import json
import logging
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pneunet.base.files.atomic import temporary_beside, write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.files.stl import write_stl
from pneunet.base.files.toml import from_table, read_toml, to_table
from pneunet.design.report.drawing import draw_drawing
from pneunet.design.report.rundata import Solution
from pneunet.design.workshop.limits import limits
from pneunet.design.workshop.pages import write_html, write_pdf
from pneunet.design.workshop.pictures import write_moulds_picture
from pneunet.design.workshop.sensitivity import sensitive
from pneunet.design.workshop.sheet import Pack, amounts, sections
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.moulds.layers import runs
from pneunet.geometry.moulds.parameters import Moulds, printed
from pneunet.reduced.rod.laws import SegmentLaw

log = logging.getLogger(__name__)


def read_moulds(path: str | Path | None) -> Moulds:
    """The Moulds in a TOML file of their keys, the default ones without a file; InputError otherwise."""
    return Moulds() if path is None else from_table(Moulds, read_toml(path), str(path))


def write_pack(
    design: DesignFile,
    directory: str | Path,
    law: SegmentLaw,
    moulds: Moulds | None = None,
    solved: Solution | None = None,
) -> Path:
    """Write the pack to the folder directory/workshop, which is returned: body.step and .stl, moulds/,
    sheet.html and .pdf, pictures, pack.json. solved: a finite element solution, whose limits count before
    estimates.

    InputError where a parameter of the moulds does not go with the body, a mould is larger than the bed, or
    a surface is not closed or is undercut.
    """
    from pneunet.geometry.cad.moulds import body_part, mould_parts

    moulds = moulds or Moulds()
    manipulator = design.manipulator
    found = runs(printed(manipulator, moulds), moulds.split_as_printed)
    with output_folder(Path(directory) / "workshop") as folder:
        log.info(f"export: {manipulator.chambers} chambers, {manipulator.length:.0f} mm")
        parts, record = [], []
        with _whole(folder / "moulds") as fresh:
            for part in mould_parts(manipulator, moulds, fresh):
                log.info(f"  {part.name}: {' x '.join(f'{v:.1f}' for v in part.size)} mm")
                record.append(_write(part, fresh))
                parts.append(part)
        record.insert(0, _write(body_part(manipulator, moulds, folder), folder))
        formed = [facts for part, facts in zip(parts, record[1:]) if part.silicone is not None]
        undercut_seen = all("undercut_mm2" in facts for facts in formed)
        if not undercut_seen:
            log.warning("warning: undercuts are not looked for: pip install 'pneunet[moulds]'")
        pack = Pack(design, moulds, parts, found, limits(design, law, solved), sensitive(design, law))
        write_moulds_picture(folder / "moulds.png", parts)
        draw_drawing(design, folder / "drawing.png")
        content = list(sections(pack))
        write_html(folder / "sheet.html", design.name, content)
        write_pdf(folder / "sheet.pdf", design, content)
        facts = {"moulds": to_table(moulds), "parts": record, "pours": _pours(pack)}
        write_text(folder / "pack.json", json.dumps(facts, indent=1) + "\n")
    checked = "closed, without undercut" if undercut_seen else "closed"
    log.info(f"{len(parts)} parts to print, {checked}; sheet: {folder / 'sheet.html'}, sheet.pdf")
    return folder


@contextmanager
def _whole(folder: Path) -> Iterator[Path]:
    """A fresh folder that takes the place of `folder` when the block ends well."""
    fresh = temporary_beside(folder)
    fresh.mkdir()
    try:
        yield fresh
        if folder.exists():
            shutil.rmtree(folder)
        fresh.rename(folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _write(part, folder):
    """Check a part and write its STL; its facts."""
    facts = part.check()
    write_stl(folder / f"{part.name}.stl", part.points[part.triangles], part.name)
    size = [round(float(v), 3) for v in part.size]
    return {"name": part.name, "count": part.count, "size_mm": size, **facts}


def _pours(pack):
    return [
        {"layer": layer, "silicone": name, "mL": round(ml, 3), "g": round(gram, 3), "casts": casts}
        for layer, name, ml, gram, casts in amounts(pack)
    ]
