"""The same as ``python -m finger_pin force-capability``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "force_capability")

if __name__ == "__main__":
    sys.exit(main())
