"""What a command line does: one file per command, joined by `application`."""

import gc

# Imports make many objects that stay, and commands few cycles: garbage is looked for rarely, which saves a fifth of a
# short command's time.
gc.set_threshold(2_000_000)
