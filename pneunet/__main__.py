"""`python -m pneunet` is the same as `pneunet`."""

import sys

if not sys.flags.safe_path:
    del sys.path[0]  # the working directory, whose numpy.py is data like anything else there

from pneunet.cli import main

sys.exit(main())
