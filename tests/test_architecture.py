"""The house keeps its floors: who may import whom, and what must work on numpy and scipy alone."""

import ast
import subprocess
import sys
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
#: what only these packages' modules may import; all else (matplotlib, pyvista) is for the inside of functions
SOLVERS = {"dolfinx", "ufl", "basix", "ffcx", "mpi4py", "petsc4py"}
LIBRARIES = {
    "base": {"numpy", "scipy"},
    "geometry": {"numpy", "scipy", "gmsh"},
    "hifi": {"numpy", "scipy", *SOLVERS},
    "reduced": {"numpy", "scipy"},
    "design": {"numpy", "scipy"},
    "pneunet": set(),
}
#: the one module of design that may reach hifi, inside its functions
VERIFICATION = "design/verification.py"
NUMPY_AND_SCIPY_ALONE = """
import importlib, pkgutil, sys

BLOCKED = {"dolfinx", "gmsh", "mpi4py", "petsc4py"}
BLOCKED |= {"vtk", "vtkmodules", "pyvista", "matplotlib", "PIL", "hifi"}

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in BLOCKED:
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocker())
names = ["geometry.parameters", "geometry.designfile"]
for package in ("base", "reduced", "design"):
    folder = importlib.import_module(package).__path__
    names += [package] + [m.name for m in pkgutil.walk_packages(folder, package + ".")]
public = 0
for name in names:
    module = importlib.import_module(name)
    wanted = getattr(module, "__all__", [a for a in vars(module) if not a.startswith("_")])
    public += len([getattr(module, attribute) for attribute in wanted])
assert not BLOCKED & set(sys.modules), BLOCKED & set(sys.modules)
print(len(names), public)
"""


def test_everything_but_finite_elements_and_cad_needs_numpy_and_scipy_alone():
    done = subprocess.run(
        [sys.executable, "-c", NUMPY_AND_SCIPY_ALONE], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    modules, public = map(int, done.stdout.split())
    assert modules >= 30 and public >= 200


def imported(path):
    """[(module, line, whether at import time)] of a file; a function's body is not run at import time."""
    found = []

    def visit(node, at_import):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                found.extend((alias.name, child.lineno, at_import) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}:{child.lineno}: relative import"
                found.extend(
                    (f"{child.module}.{alias.name}", child.lineno, at_import) for alias in child.names
                )
            visit(
                child,
                at_import and not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)),
            )

    visit(ast.parse(path.read_text()), True)
    return found


def relative(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("package", PACKAGES)
def test_floors(package):
    wrong = []
    for path in (ROOT / package).rglob("*.py"):
        for name, line, at_import in imported(path):
            top = name.split(".")[0]
            allowed = FLOORS[package]
            if relative(path) == VERIFICATION and not at_import:
                allowed = allowed | {"hifi"}
            if top in PACKAGES and top not in allowed:
                wrong.append(f"{relative(path)}:{line}: {package} must not import {name}")
            elif (
                top not in PACKAGES and at_import and top not in LIBRARIES[package] | sys.stdlib_module_names
            ):
                wrong.append(f"{relative(path)}:{line}: {name} belongs inside a function")
    assert wrong == []


def module_name(path):
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_no_module_imports_itself_through_others():
    """At import time, counting only what a module names: packages' own __init__ stay out unless they are
    named."""
    modules = {module_name(path): path for path in FILES}
    uses = {}
    for name, path in modules.items():
        named = {n for n, _, at_import in imported(path) if at_import}
        uses[name] = {m if m in modules else m.rpartition(".")[0] for m in named} & set(modules) - {name}
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

    for name in modules:
        walk(name)


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_modules_are_rooms_not_halls(path):
    """At most 400 lines, a docstring that says what the module is, no state that functions rebind."""
    text = path.read_text()
    tree = ast.parse(text)
    assert len(text.splitlines()) <= 400
    assert ast.get_docstring(tree)
    assert not [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Global)]
