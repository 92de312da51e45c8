"""Command lines that are bad for certain, made from good ones."""

from benchmarks.strange_files import Random, pick

GOOD_LINES = (
    ("init", "target"),
    ("design", "target.toml", "--law", "trained", "--outside", "warn"),
    ("shape", "design.toml", "--pressure-kPa", "5,10", "--law", "trained"),
    ("mesh", "design.toml", "--mesh-size-mm", "3"),
    ("solve", "design.toml", "--pressure-kPa", "5", "--mesh-size-mm", "3", "--no-fields"),
    ("cell", "cell.toml"),
    ("study", "study.toml", "--retry"),
    ("campaign", "campaign.toml", "--retry"),
    ("suggest", "campaign.toml", "--kind", "one-sided", "--number", "5", "--of", "10"),
    ("train", "data.npz", "--no-comparison"),
    ("report", "folder", "--law", "trained"),
    ("fit-material", "tensile.csv", "--to-strain-percent", "100", "--gauge-length-mm", "30"),
    ("run", "-n", "2"),
    ("doctor",),
)
NO_ARGUMENTS = {
    "--law": ("", "best", "none.npz", "design.toml", "x" * 5000, "Trained", "\x1b[2J.npz"),
    "--outside": ("", "perhaps", "1"),
    "--pressure-kPa": (
        "",
        "x",
        "1_0",
        "٣",
        "nan",
        "inf",
        "-5",
        "1e300",
        "5,,6",
        "5;6",
        "0x5",
        "5 kPa",
        "9999",
    ),
    "--mesh-size-mm": ("", "fine", "0", "-1", "nan", "1e300", "1_0", "٣", "1,5", "0.01", "100"),
    "--kind": ("", "both", "One-sided"),
    "--number": ("", "0", "-1", "1.5", "1_0", "٣", "9" * 5000, "1e3"),
    "--of": ("", "0", "-1", "1.5", "1_0", "٣", "9" * 5000, "1e3"),
    "--to-strain-percent": ("", "0", "-5", "nan", "1_0", "٣", "x"),
    "--gauge-length-mm": ("", "0", "-5", "nan", "1_0", "inf", "1e300"),
    "-n": ("", "0", "-1", "1.5", "1_0", "٣", "9" * 5000, "two", "1000000000"),
}
MORE_ARGUMENTS = (
    "--zzz",
    "--pressure",
    "--mesh-size",
    "-z",
    "--law=",
    "--\x1b[2J",
    "--force",
    "-" + "x" * 5000,
)


def changed_arguments(random: Random) -> tuple[tuple[str, ...], str]:
    """(a command line that is bad for certain, what is bad about it)."""
    line, way = list(pick(random, GOOD_LINES)), random.random()
    options = [i for i, word in enumerate(line) if word in NO_ARGUMENTS]
    if way < 0.5 and options:
        at = pick(random, options)
        line[at + 1] = pick(random, NO_ARGUMENTS[line[at]])
        what = f"{line[at]} {line[at + 1][:20]!r}"
    elif way < 0.6:
        line[0] = pick(random, ("", "desing", "Solve", "solve ", "--", "\x1b[2J", "x" * 5000, "0"))
        what = f"command {line[0][:20]!r}"
    elif way < 0.75 and len(line) > 1 and line[0] != "run":
        line[1] = pick(
            random,
            ("none.toml", "", ".", "folder", "x" * 300, "a\x00b.toml", "/dev/zero", "/" * 5000, "\x1b.toml"),
        )
        if line[:2] == ["report", "folder"]:
            line[1] = "nowhere"
        what = f"file {line[1][:20]!r}"
    else:
        line.insert(
            int(random.integers(1, len(line) + 1)) if line[0] != "run" else 1, pick(random, MORE_ARGUMENTS)
        )
        what = f"{line}"[:60]
    return tuple(line), what
