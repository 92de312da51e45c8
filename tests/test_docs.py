"""The pages name what exists: files and folders, modules and their names, links, and Python that parses."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FOLDERS = "base|geometry|hifi|reduced|design|pneunet|containers|tests|benchmarks|examples|docs"
#: a path that begins with a folder of the project, or a dotted name of something in `pneunet`
PATH = re.compile(rf"(?<![\w/.-])(?:{FOLDERS})/[\w./*-]*[\w*/]")
DOTTED = re.compile(r"(?<![\w/.-])pneunet(?:\.\w+)+(?![\w/])")
#: the import names of old; `design.toml` and the like are files, `design.solve` is a method
OLD = re.compile(
    r"(?<![\w/.-])(?:(?:base|geometry|hifi|reduced)\.[a-z]\w+|design\.(?:run|shape|target|search|report)\.)"
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
BLOCK = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
SUFFIXES = {"md", "toml", "csv", "png", "msh", "npz", "html", "json"}


def name(page):
    return page.relative_to(ROOT).as_posix()


def module_file(parts):
    """File of a module by the parts of its name under `pneunet`; None where there is none."""
    base = ROOT / "pneunet" if not parts or not (ROOT / parts[0]).is_dir() else ROOT
    path = base.joinpath(*parts)
    return next((p for p in (path / "__init__.py", path.with_suffix(".py")) if p.is_file()), None)


def top_names(path):
    """Names that a module defines or imports, and strings of tables of lazily imported names."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {(alias.asname or alias.name).split(".")[0] for alias in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and path.name == "__init__.py":
            names.add(node.value)
    return names


def exists(dotted):
    """Whether `pneunet.a.b` is a module, or a name in one (a method counts as its class's)."""
    parts = dotted.split(".")[1:]
    for split in range(len(parts), -1, -1):
        path = module_file(parts[:split])
        if path is not None:
            return split == len(parts) or parts[split] in top_names(path)
    return False


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_what_a_page_names_exists(page):
    text = page.read_text()
    paths = {p for p in PATH.findall(text) if not (list(ROOT.glob(p)) if "*" in p else (ROOT / p).exists())}
    dotted = {d for d in DOTTED.findall(text) if d.split(".")[1] not in SUFFIXES and not exists(d)}
    old = {o for o in OLD.findall(text) if o.split(".")[1] not in SUFFIXES}
    assert (paths, dotted, old) == (set(), set(), set())


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=name)
def test_links_lead_somewhere(page):
    targets = {link.partition("#")[0] for link in LINK.findall(page.read_text()) if "://" not in link}
    assert {t for t in targets if t and not (page.parent / t).exists()} == set()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_python_of_a_page_parses_and_imports_what_exists(page):
    wrong = []
    for block in BLOCK.findall(page.read_text()):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module.partition(".")[0] == "pneunet":
                wrong += [
                    f"{node.module}.{a.name}" for a in node.names if not exists(f"{node.module}.{a.name}")
                ]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_modules_that_a_page_runs_exist(page):
    """`python -m benchmarks`, `python -m pneunet.reduced.analytic.printed`, `make target`."""
    text = page.read_text()
    modules = set(re.findall(r"python3? -m ([\w.]+\w)", text)) - {"pytest"}
    files = {
        m: module_file(m.split(".")[1:]) if m.startswith("pneunet") else module_file(m.split("."))
        for m in modules
    }
    assert [m for m, path in files.items() if path is None] == []
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= set(targets)
