"""The commands of the command line: one file each, joined by `application`."""

import gc
import os

# Imports make many objects that stay, and commands few cycles: garbage is looked for rarely, which saves a fifth of a
# short command's time.
gc.set_threshold(2_000_000)

# Matrices are small here: threads of their own take longer to start, and to wait for, than they save.
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# To look for plugins of pydantic takes reading the metadata of every package that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
