"""Tables of descriptions with some entries changed."""

import copy


def with_entries(table, entries):
    """Return a table with entries at keys whose dots are double underscores; None takes one away."""
    table = copy.deepcopy(table)
    for key, value in entries.items():
        *path, last = key.split("__")
        inner = table
        for part in path:
            inner = inner[part]
        if value is None:
            del inner[last]
        else:
            inner[last] = value
    return table
