"""`python -m pneunet` is the same as `pneunet`."""

import sys

from pneunet.cli import main

sys.exit(main())
