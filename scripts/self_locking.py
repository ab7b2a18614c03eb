"""The same as ``python -m finger_pin self-locking``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "self_locking")

if __name__ == "__main__":
    sys.exit(main())
