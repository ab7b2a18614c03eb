"""The same as ``python -m finger_pin observe``."""

import sys
from functools import partial

from finger_pin.commands.application import run

main = partial(run, "observe")

if __name__ == "__main__":
    sys.exit(main())
