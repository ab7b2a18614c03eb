"""Draw the paper's figures."""

import sys
from functools import partial

from paper.reproduce import reproduce

from finger_pin.commands.application import run_function

main = partial(run_function, reproduce)

if __name__ == "__main__":
    sys.exit(main())
