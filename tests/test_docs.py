"""The pages name what exists: files and folders, modules and their names, links, and Python that parses."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FOLDERS = "base|geometry|hifi|reduced|design|pneunet|containers|tests|benchmarks|examples|docs"
#: not inside of another word or path, nor a table of a TOML file
FREE = r"(?<![\w/.\[-])"
#: a path that begins with a folder of the project, a dotted name of something in `pneunet`
PATH = re.compile(rf"{FREE}(?:{FOLDERS})/[\w./*-]*[\w*/]")
DOTTED = re.compile(rf"{FREE}pneunet(?:\.\w+)+(?![\w/])")
#: the import names of old; `design.solve` and the like are methods of a design
OLD = re.compile(
    rf"{FREE}(?:(?:base|geometry|hifi|reduced)\.[a-z]|design\.(?:run|shape|target|search|report)\.)\w+"
)
#: a name at the front door
FRONT = re.compile(rf"{FREE}pn\.(\w+)")
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.M)
PYTHON = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
COMMAND = re.compile(r"python3? -m ([\w.]+\w)")


def name(page):
    return page.relative_to(ROOT).as_posix()


def module_file(dotted):
    """File of a module by its import name; None where there is none."""
    first, _, rest = dotted.partition(".")
    hanging = first == "pneunet" and (ROOT / rest.partition(".")[0]).is_dir()
    path = (ROOT if hanging and rest else ROOT / first).joinpath(*rest.split("."))
    return next((p for p in (path / "__init__.py", path.with_suffix(".py")) if p.is_file()), None)


def names_in(path):
    """Names that a module defines, imports or, as a package's tables of lazy names do, writes as text."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            yield node.name
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.Constant) and path.name == "__init__.py":
            yield node.value


def exists(dotted):
    """Whether `pneunet.a.b` is a module or a name in one. Nothing is imported: this needs no dolfinx."""
    module, _, last = dotted.rpartition(".")
    path = module_file(module)
    return bool(module_file(dotted)) or bool(path) and last in set(names_in(path))


def anchors(page):
    """What links to the headings of a page end with."""
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in HEADING.findall(page.read_text())}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_what_a_page_names_exists(page):
    text = page.read_text()
    paths = {p for p in PATH.findall(text) if not any(ROOT.glob(p.rstrip("/")))}
    named = {*DOTTED.findall(text), *(f"pneunet.{n}" for n in FRONT.findall(text))}
    dotted = {d for d in named if not exists(d)}
    modules = {m for m in COMMAND.findall(text) if m != "pytest" and not module_file(m)}
    assert (paths, dotted, modules, set(OLD.findall(text))) == (set(), set(), set(), set())
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= set(targets)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=name)
def test_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text()):
        if "://" not in link:
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_python_of_a_page_parses_and_imports_what_exists(page):
    for block in PYTHON.findall(page.read_text()):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom):
                first = node.module.partition(".")[0]
                assert first == "pneunet" or first not in FOLDERS.split("|"), node.module
                if first == "pneunet":
                    assert [a.name for a in node.names if not exists(f"{node.module}.{a.name}")] == []
