"""Write the URDF of every shipped finger to urdf/, or check that the files there are current."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from finger_pin.commands.application import run_function
from finger_pin.description.loading import load_finger
from finger_pin.description.tables import list_fingers
from finger_pin.mechanism.urdf import to_urdf

FOLDER = Path(__file__).resolve().parents[1] / "urdf"


def generate_urdf(
    check: Annotated[bool, typer.Option("--check", help="Write nothing; fail if a file is not current.")] = False,
) -> int:
    """Write the URDF of every shipped finger to urdf/, or check that the files there are current."""
    texts = {f"{name}.urdf": to_urdf(load_finger(name)) for name in list_fingers()}
    present = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.urdf")}
    stale = sorted(name for name in texts.keys() | present.keys() if texts.get(name) != present.get(name))
    for name in stale:
        path = FOLDER / name
        if check:
            print(f"urdf/{name} is not current; run python scripts/generate_urdf.py", file=sys.stderr)
        elif name in texts:
            FOLDER.mkdir(exist_ok=True)
            path.write_text(texts[name], encoding="utf-8", newline="\n")
            print(f"wrote urdf/{name}")
        else:
            path.unlink()
            print(f"removed urdf/{name}: no such finger")
    return int(check and bool(stale))


main = partial(run_function, generate_urdf)

if __name__ == "__main__":
    sys.exit(main())
