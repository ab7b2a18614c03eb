"""The data of a page that plays, unpacked from its text."""

import base64
import json
import re
import zlib

import numpy as np


def unpacked(text):
    """Return the scene on a page, and the columns of its frames by name."""
    scene, frames = (
        zlib.decompress(base64.b64decode(re.search(rf'<script type="text/plain" id="{name}">(.*?)</script>', text)[1]))
        for name in ("scene", "frames")
    )
    found, columns, first = json.loads(scene), {}, 0
    # The numbers of a column follow those of the one before it.
    row = sum(width * np.dtype(kind).itemsize for _, kind, width in found["columns"])
    for name, kind, width in found["columns"]:
        columns[name] = np.frombuffer(frames, kind, len(frames) // row * width, first)
        first += columns[name].nbytes
    assert first == len(frames)
    return found, columns
