"""Notebooks: committed without output, through the front door alone, each executed in a kernel."""

import ast
import json

import pytest

from examples.notebooks import NOTEBOOKS, execute

#: beside pneunet and Python's own
LIBRARIES = {"matplotlib", "numpy", "pyvista"}


def cells(path, kind):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == kind]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_has_no_output_and_goes_through_the_front_door(path):
    assert cells(path, "markdown")[0]["source"][0].startswith("# ")
    for cell in cells(path, "code"):
        assert (cell["outputs"], cell["execution_count"], cell["metadata"]) == ([], None, {})
        for node in ast.walk(ast.parse("".join(cell["source"]))):
            assert not isinstance(node, ast.ImportFrom) or not node.module.startswith("pneunet")
            for alias in node.names if isinstance(node, ast.Import) else ():
                top = alias.name.partition(".")[0]
                assert top in LIBRARIES or (alias.name, alias.asname) == ("pneunet", "pn")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_to_its_end(path, tmp_path):
    pytest.importorskip("nbclient", reason="no Jupyter: apt-get install python3-nbclient python3-ipykernel")
    if path.stem == "finite_elements":
        pytest.importorskip("dolfinx", reason="no finite elements: make setup")
        pytest.importorskip("pandas", reason="no pandas: apt-get install python3-pandas")
    done = execute(path, tmp_path)
    assert all(cell.execution_count for cell in done.cells if cell.cell_type == "code")
    assert (tmp_path / "out").is_dir() or path.stem == "measured_and_predicted"
