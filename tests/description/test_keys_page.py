"""The pages of all keys and of all variables: complete, with units and meanings, and current."""

import re
import tomllib

import generate_keys
import pytest

import finger_pin as fp
from finger_pin.description.loading import to_toml
from finger_pin.description.tables import list_scenarios

ROW = re.compile(r"^\| `([^`]+)` \| ([^|]*) \| (.*) \|$", re.MULTILINE)


def flat(table, prefix=""):
    for key, value in table.items():
        name = f"{prefix}{key}"
        yield name
        if isinstance(value, dict):
            yield from flat(value, f"{name}.")


@pytest.mark.slow
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


def test_every_key_has_a_meaning_in_words():
    for key, _, rest in ROW.findall(generate_keys.PAGE.read_text("utf-8")):
        # Sources stand in brackets; symbols have a letter or two.
        meaning = re.sub(r" \((?:[^()]|\([^()]*\))*\)$", "", rest.partition(" | ")[2])
        assert len(re.findall(r"[A-Za-z]{2,}", meaning)) >= 2 and re.search(r"[A-Za-z]{4,}", meaning), (key, meaning)


@pytest.mark.parametrize("name", ["grasp", "servo_position", "underactuated"])
def test_every_variable_of_a_result_is_on_the_page_with_its_unit(name):
    page = generate_keys.VARIABLES.read_text("utf-8")
    rows = re.findall(r"^\| `([^|]*)` \| ([^|]*) \| ([^|]*) \| [^|]{4,} \|$", page, re.MULTILINE)
    known = {each: (unit or "1", dims) for names, unit, dims in rows for each in names.split("`, `")}
    result = fp.simulate(fp.load_scenario(name, {"simulation.duration": 0.005}))
    for each, values in result.items():
        shown = ", ".join(map(str, values.dims[1:]))
        table = "" if each in known else shown
        units, dims = known[each.replace(table, "<table>") if table else each]
        assert values.attrs["units"] in re.split(", | or ", units), each
        assert table or shown == dims or (shown or "none") in dims.split(" or "), each
