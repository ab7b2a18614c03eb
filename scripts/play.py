"""The same as ``python -m finger_pin play``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "play")

if __name__ == "__main__":
    sys.exit(main())
