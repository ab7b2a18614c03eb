"""Compare controllers on the paper's Fig. 6."""

import sys
from functools import partial

from paper.controllers import controllers

from finger_pin.commands.application import run_function

main = partial(run_function, controllers)

if __name__ == "__main__":
    sys.exit(main())
