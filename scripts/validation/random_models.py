"""Random models through the table of doors that stands beside the tests."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

from finger_pin.commands.console import bar, print_text

_TESTS = Path(__file__).parents[2] / "tests"


def check(count: int, first_seed: int) -> int:
    """Send models of consecutive seeds through all doors, and print what fails; return how many checks failed."""
    sys.path[:0] = [str(_TESTS), str(_TESTS / "core")]
    from random_table import DOORS

    failed = 0
    with warnings.catch_warnings(), bar(sys.stderr.isatty(), "models", count) as show:
        warnings.simplefilter("ignore")
        for seed in range(first_seed, first_seed + count):
            show(seed - first_seed, text=f"seed {seed}", note=f"{failed} failed" if failed else "")
            for name, door in DOORS.items():
                model = door.model(seed)
                if reason := door.fails(model):
                    failed += 1
                    smallest = door.smallest(model)
                    features = ", ".join(smallest.features) or "no features"
                    print_text(f"seed {seed}, {name}: {reason}\n  smallest: {smallest.kind} with {features}")
    print_text(f"{count} models from seed {first_seed} on, {len(DOORS)} doors: {failed} checks failed")
    return failed
