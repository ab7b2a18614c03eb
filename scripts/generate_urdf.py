"""Write the URDF of every shipped finger to urdf/, or check that the files there are current."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from finger_pin.description.loading import list_fingers, load_finger
from finger_pin.mechanism.urdf import to_urdf

FOLDER = Path(__file__).resolve().parents[1] / "urdf"


def main(arguments: list[str] | None = None) -> int:
    """Write or check the files; return the exit code, 1 where a check fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is not current")
    check = parser.parse_args(arguments).check
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


if __name__ == "__main__":
    sys.exit(main())
