"""Compare the numbers of two JSON files: compare.py ONE TWO [--rtol 1e-6] [--atol 1e-9].

Prints a line for every key that differs and exits with 1 if there is one.
"""

import argparse
import json
import math
import sys
from pathlib import Path


def leaves(value, key=""):
    """(key, value) of everything in nested objects and lists, keys like `step[3].tip_mm`."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from leaves(inner, f"{key}[{index}]")
    else:
        yield key, value


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def differences(one: dict, two: dict, rtol: float, atol: float) -> list[str]:
    """A line for every key whose values differ, or that only one of the two has."""
    lines = [f"{key}: only in one of the two" for key in one.keys() ^ two.keys()]
    for key in one.keys() & two.keys():
        a, b = one[key], two[key]
        if is_number(a) and is_number(b):
            if not math.isclose(a, b, rel_tol=rtol, abs_tol=atol):
                lines.append(f"{key}: {a!r} and {b!r}, difference {abs(a - b):.1e}")
        elif a != b:
            lines.append(f"{key}: {a!r} and {b!r}")
    return sorted(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("one", type=Path)
    parser.add_argument("two", type=Path)
    parser.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance (default %(default)s)")
    parser.add_argument(
        "--atol", type=float, default=1e-9, help="absolute tolerance, for zeros (default %(default)s)"
    )
    args = parser.parse_args()
    one, two = (dict(leaves(json.loads(path.read_text()))) for path in (args.one, args.two))
    if not any(is_number(value) for value in one.values()):
        print(f"{args.one}: no numbers to compare")
        return 1
    lines = differences(one, two, args.rtol, args.atol)
    print(
        *lines, f"{len(lines)} of {len(one.keys() | two.keys())} values differ (rtol {args.rtol:g})", sep="\n"
    )
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
