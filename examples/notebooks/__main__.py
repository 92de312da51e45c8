"""Execute all notebooks, each in a folder of its own; a line says how long each took."""

import tempfile
import time
from pathlib import Path

from examples.notebooks import NOTEBOOKS, execute

for path in NOTEBOOKS:
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        execute(path, Path(folder))
        print(f"{path.name}: {time.perf_counter() - started:.1f} s", flush=True)
