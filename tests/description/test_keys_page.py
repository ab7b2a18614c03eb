"""The page of all keys: complete, with units, and current."""

import re
import tomllib

import generate_keys

import finger_pin as fp
from finger_pin.description.loading import list_scenarios, to_toml

ROW = re.compile(r"^\| `([^`]+)` \| ([^|]*) \| (.*) \|$", re.MULTILINE)


def flat(table, prefix=""):
    for key, value in table.items():
        name = f"{prefix}{key}"
        yield name
        if isinstance(value, dict):
            yield from flat(value, f"{name}.")


def test_every_key_of_what_ships_is_on_the_page_and_the_page_is_current():
    assert generate_keys.main(["--check"]) == 0
    rows = {key: unit.strip() for key, unit, _ in ROW.findall(generate_keys.PAGE.read_text("utf-8"))}
    shapes = [re.escape(key).replace(r"<name>", r"[^.]+").replace(r"<key>", r".+") for key in rows]
    # A table has no row where it needs no words: those of its entries stand for it.
    known = re.compile("|".join(shapes))
    tables = {shape.rpartition(r"\.")[0] for shape in shapes}
    for name in list_scenarios():
        scenario = fp.load_scenario(name)
        # In a hand, tables by joint and tendon stand in one of their finger.
        fingers = "|".join(scenario.hand.fingers) if scenario.hand else "none"
        for key in flat(tomllib.loads(to_toml(scenario))):
            plain = re.sub(rf"^((?:reference|simulation|controller)\..*?\.)(?:{fingers})\.", r"\1", key)
            assert (
                known.fullmatch(plain)
                or plain.rpartition(".")[2] in fingers.split("|")
                or any(re.fullmatch(table, plain) for table in tables)
            ), key
    units = {"finger.gravity": "m/s2", "finger.tendon_friction.stiffness": "N/m", "simulation.duration": "s"}
    assert units.items() <= rows.items()
    assert rows["finger.tendons.<name>.crossings.<name>.radius"] == "m"
