"""Measure the error of the joint reaction (17) along a scenario."""

import sys
from functools import partial

from paper.reaction import reaction

from finger_pin.commands.application import run_function

main = partial(run_function, reaction)

if __name__ == "__main__":
    sys.exit(main())
