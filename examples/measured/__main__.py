"""`python -m examples.measured [--fe]`: public measurements beside what is computed; --fe: the beam as a body
of finite elements too (half a minute)."""

import sys

from examples.measured import arm, beam


def main():
    for module, lines in ((beam, beam.lines("--fe" in sys.argv[1:])), (arm, arm.lines())):
        print("\n".join([module.__doc__.strip().split("\n")[0], *(f"  {line}" for line in lines), ""]))


if __name__ == "__main__":
    main()
