"""The pages name what exists: files and folders, modules and their names, links, and Python that parses."""

import ast
import re
from pathlib import Path

import pytest

from docs.site.blocks import blocks, pages
from docs.site.check import faults
from docs.site.run import MADE, WrongBlock, run_page
from pneunet.design.search.space import RANGES as VARIED
from pneunet.geometry.parameters import ONE_SIDED, PASSIVE, TWISTING
from pneunet.hifi.runs.campaign.sample import RANGES

ROOT = Path(__file__).resolve().parents[1]
PAGES = pages()
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
        if "://" not in link and not link.startswith(MADE):  # what a page's commands make, the build asks for
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


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_of_a_page_could_be_run(page):
    assert faults(page.read_text()) == []


@pytest.mark.parametrize(
    "text, fault",
    [
        ("<!-- long: days -->\n```sh\npneunet shape a.toml --pressure-MPa 1\n```\n", "--pressure-MPa"),
        ("<!-- long: days -->\n```sh\nmpirun -n 3 pneunet studdy a.toml\n```\n", "studdy"),
        ("<!-- long: days -->\n```sh\nmake bench && make nothing\n```\n", "nothing"),
        ("<!-- long: days -->\n```sh\npython -m benchmarks --only house --no-such\n```\n", "--no-such"),
        ("<!-- long: days -->\n```sh\nfrobnicate a.toml\n```\n", "frobnicate"),
        ("run `pneunet solve --resum` then", "--resum"),
        ("<!-- soon -->\n```sh\nls\n```\n", "remark"),
        ("```\nls\n```\n", "a block of ''"),
        ("    pneunet doctor\n", "indented"),
    ],
)
def test_a_command_that_could_not_be_run_is_named(text, fault):
    assert [line for line in faults(text) if fault in line]


PAGE = """
```csv title="a.csv"
1,2
```

```sh
cat a.csv > out.csv   # a comment
echo "read $(wc -l < a.csv) row"
```

```text
read ... row
```

```python
rows = len(open("out.csv").readlines())
```

```python
assert rows == 1
```

<!-- exits 3 -->
```sh
exit 3
```

<!-- long: for ever -->
```sh
sleep 1e9
```
"""


def test_a_page_is_run_in_its_order(tmp_path):
    assert run_page(PAGE, tmp_path) == {"commands": 3, "python": 2, "files": 1, "long": 1}
    assert (tmp_path / "out.csv").read_text() == "1,2\n"


@pytest.mark.parametrize(
    "right, wrong", [("exits 3", "exits 2"), ("read ... row", "read 7 rows"), ("rows == 1", "rows == 2")]
)
def test_a_page_that_says_otherwise_fails_with_its_line(tmp_path, right, wrong):
    text = PAGE.replace(right, wrong)
    above = text.splitlines()
    line = next(block.line for block in blocks(text) if wrong in above[block.line - 2] + block.text)
    with pytest.raises(WrongBlock, match=f"line {line}"):
        run_page(text, tmp_path)


def test_the_reference_has_every_name_of_the_front_door():
    import pneunet

    named = re.findall(r"^::: pneunet\.([\w.]+)$", (ROOT / "docs" / "api.md").read_text(), re.M)
    assert sorted(named) == sorted(f"{place}.{name}" for name, place in pneunet._PLACES.items())


def table(page, header):
    """{first cell: (two numbers)} of the table of a page whose header row has these cells first."""
    rows = (ROOT / "docs" / page).read_text().partition(f"| {' | '.join(header)} |")[2].split("\n\n")[0]
    cells = ([c.strip(" `") for c in row.split("|")[1:4]] for row in rows.splitlines()[2:])
    return {key: tuple(float(value.split()[0]) for value in both) for key, *both in cells}


def test_tables_of_ranges_are_those_of_the_code():
    every = RANGES[ONE_SIDED] | RANGES[TWISTING]
    assert table("rod-law.md", ("key", "from", "to")) == every
    told, bounds = table("use-design.md", ("dimension", "from", "to")), {}
    for kind in (ONE_SIDED, TWISTING, PASSIVE):
        bounds |= {name: both for name, (both, _) in VARIED[kind].items()}
    told = {key.partition(" (")[0].replace(" ", "_"): both for key, both in told.items()}
    told["plain_length"] = told.pop("length_of_a_passive_segment")
    assert told == bounds
