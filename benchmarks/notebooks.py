"""The notebooks of examples/notebooks, each executed in a kernel: the part `notebooks`."""

import tempfile
import time
from pathlib import Path

from examples.notebooks import NOTEBOOKS, execute


def notebooks():
    """How many run to their end."""
    from nbclient.exceptions import CellExecutionError

    seconds = {}
    for path in NOTEBOOKS:
        started = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            try:
                execute(path, Path(folder))
            except CellExecutionError as error:
                print(f"  {path.name}: {error}", flush=True)
                continue
        seconds[path.stem] = time.perf_counter() - started
        print(f"  {path.name}: {seconds[path.stem]:.1f} s", flush=True)
    return {"notebooks_executed": len(seconds)}, {"of": len(NOTEBOOKS), "seconds": seconds}
