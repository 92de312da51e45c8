"""Surfaces of quads as ParaView reads them (.vtp), without VTK."""

import base64
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from pneunet.base.files.atomic import write_text

_TYPES = {"f8": "Float64", "i4": "Int32"}


def write_quads(
    path: str | Path, vertices: np.ndarray, quads: np.ndarray, cell_data: dict[str, np.ndarray]
) -> None:
    """Write vertices (n, 3), quads (m, 4) and whole numbers {name: (m,)} of the quads."""
    m = len(quads)
    values = "\n".join(_array(name, data.astype("<i4")) for name, data in cell_data.items())
    ends = _array("offsets", np.arange(4, 4 * m + 1, 4, dtype="<i4"))
    text = f"""<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32">
<PolyData>
<Piece NumberOfPoints="{len(vertices)}" NumberOfPolys="{m}">
<CellData>
{values}
</CellData>
<Points>
{_array("Points", vertices.astype("<f8"), 3)}
</Points>
<Polys>
{_array("connectivity", quads.ravel().astype("<i4"))}
{ends}
</Polys>
</Piece>
</PolyData>
</VTKFile>
"""
    write_text(path, text)


def _array(name, values, components=1):
    data = np.ascontiguousarray(values).tobytes()
    content = base64.b64encode(np.array([len(data)], "<u4").tobytes() + data).decode()
    kind = _TYPES[values.dtype.str[1:]]
    about = f'type="{kind}" Name={quoteattr(name)} NumberOfComponents="{components}" format="binary"'
    return f"<DataArray {about}>{content}</DataArray>"
