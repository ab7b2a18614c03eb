"""``python -m finger_pin COMMAND``."""

import sys

from finger_pin.commands.application import run

if __name__ == "__main__":
    sys.exit(run())
