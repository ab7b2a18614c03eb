"""The same as ``python -m finger_pin controllers``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "controllers")

if __name__ == "__main__":
    sys.exit(main())
