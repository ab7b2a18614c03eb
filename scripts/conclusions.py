"""Put the paper's three conclusions to the test."""

import sys
from functools import partial

from paper.conclusions import conclusions

from finger_pin.commands.application import run_function

main = partial(run_function, conclusions)

if __name__ == "__main__":
    sys.exit(main())
