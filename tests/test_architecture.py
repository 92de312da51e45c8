"""The house keeps its floors and rooms: who may import whom, and what must work on numpy and scipy alone."""

import ast
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("base", "geometry", "hifi", "reduced", "design", "pneunet")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
#: package -> packages its modules may import when they are imported themselves
FLOORS = {
    "base": {"base"},
    "geometry": {"geometry", "base"},
    "hifi": {"hifi", "geometry", "base"},
    "reduced": {"reduced", "geometry", "base"},
    "design": {"design", "reduced", "geometry", "base"},
    "pneunet": set(PACKAGES),
}
#: rooms of a package from the ground up: a room's modules may import those of its own storey and below; "" is
#: what lies in the package itself
ROOMS = {
    "base": [{""}, {"files"}, {"materials", "system", "pictures"}],
    "geometry": [{""}, {"grids", "moulds"}, {"cad"}],
    "hifi": [
        {"fem"},
        {"path"},
        {"contact"},
        {"cell", "body"},
        {"runs"},
        {"runs/solve", "runs/campaign"},
        {"runs/study"},
        {"verification"},
    ],
    "reduced": [{"rod"}, {"analytic", "trained"}, {""}, {"training"}],
    "design": [{"target"}, {"segmentation"}, {"search"}, {"report"}, {"workshop"}, {""}, {"measured"}],
}
#: what only these packages' modules may import; all else (matplotlib, pyvista) is for the inside of functions
SOLVERS = {"dolfinx", "ufl", "basix", "ffcx", "mpi4py", "petsc4py"}
LIBRARIES = {
    "base": {"numpy", "scipy"},
    "geometry": {"numpy", "scipy", "gmsh"},
    "hifi": {"numpy", "scipy", *SOLVERS},
    "reduced": {"numpy", "scipy"},
    "design": {"numpy", "scipy"},
    "pneunet": {"numpy"},
}
#: the one module of design that may reach hifi, inside its functions
CHAIN = "design/chain.py"
NUMPY_AND_SCIPY_ALONE = """
import importlib, pkgutil, sys

BLOCKED = {"dolfinx", "gmsh", "mpi4py", "petsc4py", "vtk", "vtkmodules", "pyvista", "matplotlib", "PIL"}
BLOCKED |= {"trimesh", "manifold3d", "plotly", "shtab"}
BLOCKED |= {"fcntl", "resource"}  # of Linux and macOS alone

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in BLOCKED or name.startswith("pneunet.hifi"):
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocker())
import pneunet
names = [m.name for m in pkgutil.iter_modules(pneunet.__path__, "pneunet.") if m.name != "pneunet.__main__"]
for package in ("pneunet.base", "pneunet.geometry", "pneunet.reduced", "pneunet.design"):
    folder = importlib.import_module(package).__path__
    names += [package] + [m.name for m in pkgutil.walk_packages(folder, package + ".")]
names = [name for name in set(names) if not name.startswith(("pneunet.geometry.cad.", "pneunet.hifi"))]
public = 0
for name in names:
    module = importlib.import_module(name)
    wanted = getattr(module, "__all__", [a for a in vars(module) if not a.startswith("_")])
    public += len([getattr(module, attribute) for attribute in wanted])
found = {name for name in BLOCKED if sys.modules.get(name)}
assert not found, found
print(len(names), public)
"""


def test_everything_but_finite_elements_and_cad_needs_numpy_and_scipy_alone():
    command = [sys.executable, "-c", NUMPY_AND_SCIPY_ALONE]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    modules, public = map(int, done.stdout.split())
    assert modules >= 30 and public >= 200


def imported(path):
    """[(module, line, whether at import time)] of a file; a function's body is not run at import time."""
    found = []

    def visit(node, at_import):
        for child in ast.iter_child_nodes(node):
            here = at_import
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                here = False
            if isinstance(child, ast.Import):
                found.extend((alias.name, child.lineno, here) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}:{child.lineno}: relative import"
                found.extend((f"{child.module}.{alias.name}", child.lineno, here) for alias in child.names)
            visit(child, here and not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)))

    visit(ast.parse(path.read_text()), True)
    return found


def relative(path):
    return path.relative_to(ROOT).as_posix()


def module_name(path):
    """Import name of a file: the folders at the top hang under `pneunet`."""
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    parts = parts[:-1] if parts[-1] == "__init__" else parts
    return ".".join(parts if parts[0] == "pneunet" else ["pneunet", *parts])


MODULES = {module_name(path): path for path in FILES}


def own(name):
    """(package, file) of an imported name, the longest of its parts that is a module; None for others'."""
    while name and name not in MODULES:
        name = name.rpartition(".")[0]
    return (MODULES[name].relative_to(ROOT).parts[0], MODULES[name]) if name else None


@pytest.mark.parametrize("package", PACKAGES)
def test_floors(package):
    wrong = []
    for path in (ROOT / package).rglob("*.py"):
        for name, line, at_import in imported(path):
            found, allowed = own(name), FLOORS[package]
            if relative(path) == CHAIN and not at_import:
                allowed = allowed | {"hifi"}
            if found and found[0] not in allowed:
                wrong.append(f"{relative(path)}:{line}: {package} must not import {name}")
            top = name.split(".")[0]
            known = LIBRARIES[package] | sys.stdlib_module_names
            if relative(path).startswith("hifi/verification/"):
                known = known | {"gmsh"}  # its bodies are meshed here, not bodies that users build
            if not found and at_import and top not in known:
                wrong.append(f"{relative(path)}:{line}: {name} belongs inside a function")
    assert wrong == []


def room(path, package):
    return path.parent.relative_to(ROOT / package).as_posix().replace(".", "", 1)


@pytest.mark.parametrize("package", ROOMS)
def test_no_arrow_runs_up_between_rooms(package):
    storey = {name: number for number, names in enumerate(ROOMS[package]) for name in names}
    wrong = []
    for path in (ROOT / package).rglob("*.py"):
        here = room(path, package)
        if path.name == "__init__.py":
            continue
        for name, line, _ in imported(path):
            found = own(name)
            if not found or found[0] != package:
                continue
            there = room(found[1], package)
            if storey[there] > storey[here] or (storey[there] == storey[here] and there != here):
                wrong.append(f"{relative(path)}:{line}: {here or package} must not import {name}")
    assert wrong == []


def test_no_module_imports_itself_through_others():
    """At import time, counting what a module names: packages' own __init__ stay out unless they are named."""
    uses = {}
    for name, path in MODULES.items():
        named = {n for n, _, at_import in imported(path) if at_import}
        uses[name] = {m if m in MODULES else m.rpartition(".")[0] for m in named} & set(MODULES) - {name}
    done, trail = set(), []

    def walk(name):
        assert name not in trail, "import cycle: " + " -> ".join([*trail[trail.index(name) :], name])
        if name in done:
            return
        trail.append(name)
        for other in sorted(uses[name]):
            walk(other)
        trail.pop()
        done.add(name)

    for name in MODULES:
        walk(name)


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_modules_are_rooms_not_halls(path):
    """At most 400 lines, a docstring that says what the module is, no state that functions rebind."""
    text = path.read_text()
    tree = ast.parse(text)
    assert len(text.splitlines()) <= 400
    assert ast.get_docstring(tree)
    assert not [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Global)]


def test_no_two_public_classes_share_a_name():
    places = defaultdict(list)
    for path in FILES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(relative(path))
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_public_functions_are_annotated(package):
    """Every argument and the answer of functions and methods without an underscore."""
    bare = []
    for path in (ROOT / package).rglob("*.py"):
        if relative(path).startswith("hifi/verification/"):
            continue  # problems, which tests and the bench call alone
        tree = ast.parse(path.read_text())
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name[0] != "_"]
        for node in [n for place in (tree, *classes) for n in place.body if isinstance(n, ast.FunctionDef)]:
            if node.name.startswith("_"):
                continue
            a = node.args
            given = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
            named = [arg for arg in given if arg.annotation is None and arg.arg not in ("self", "cls")]
            if named or node.returns is None:
                bare.append(f"{relative(path)}:{node.lineno}: {node.name}")
    assert bare == []
