"""Notebooks, without output; `python -m examples.notebooks` executes them all."""

from pathlib import Path

NOTEBOOKS = tuple(sorted(Path(__file__).parent.glob("*.ipynb")))


def execute(path: Path, folder: Path, seconds: float = 600.0):
    """The executed notebook, in a kernel of this Python and a working directory of its own.

    nbclient's CellExecutionError where a cell fails.
    """
    import sys

    import nbformat
    from jupyter_client.manager import AsyncKernelManager
    from nbclient import NotebookClient

    manager = AsyncKernelManager(kernel_name="python3")
    # not the Python that the system's kernel is of
    manager.kernel_spec.argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    return NotebookClient(notebook, km=manager, timeout=seconds, resources=resources).execute()
