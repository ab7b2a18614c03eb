"""The same as ``python -m finger_pin export``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "export")

if __name__ == "__main__":
    sys.exit(main())
