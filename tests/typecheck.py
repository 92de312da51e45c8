"""`python -m tests.typecheck [FOLDER ...]`: mypy on base, geometry, reduced, design and pneunet, or on some
of them.

mypy follows folders, not setuptools' package-dir mapping: out/types gets links that look as the wheel does.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CHECKED = ("base", "geometry", "reduced", "design", "pneunet")


def as_installed():
    """The folder under which the packages hang as in the wheel, by links: made anew."""
    top = ROOT / "out" / "types" / "pneunet"
    top.mkdir(parents=True, exist_ok=True)
    wanted = {path.name: path for path in (ROOT / "pneunet").iterdir() if path.suffix in (".py", ".typed")}
    wanted |= {name: ROOT / name for name in ("base", "geometry", "hifi", "reduced", "design")}
    for link in top.iterdir():
        link.unlink()
    for name, path in wanted.items():
        (top / name).symlink_to(path)
    return top


def mypy(folders=CHECKED):
    """The finished process of mypy on the folders."""
    top = as_installed()
    names = [f"pneunet.{name}" for name in folders if name != "pneunet"]
    if "pneunet" in folders:
        names += [
            f"pneunet.{path.stem}" for path in (ROOT / "pneunet").glob("*.py") if path.stem != "__init__"
        ]
    line = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml")]
    for name in names:
        line += ["-p" if (top / name.rpartition(".")[2]).is_dir() else "-m", name]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True)


if __name__ == "__main__":
    done = mypy(sys.argv[1:] or CHECKED)
    print(done.stdout + done.stderr, end="")
    sys.exit(done.returncode)
