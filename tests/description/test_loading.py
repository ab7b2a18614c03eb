"""Input: what is accepted, and how it is put together."""

import tomllib

import numpy as np
import pytest
from wrong_inputs import PLANAR

import finger_pin as fp
from finger_pin.description.loading import load_finger, load_scenario, to_toml
from finger_pin.description.tables import list_fingers, list_scenarios
from finger_pin.exceptions import InputError


@pytest.mark.parametrize("name", list_scenarios())
def test_every_shipped_scenario_loads(name):
    assert load_scenario(name).name == name


@pytest.mark.parametrize("name", list_fingers())
def test_every_shipped_finger_loads(name):
    assert load_finger(name).name == name


def test_listings_have_a_line_about_each():
    assert {"ub_stand_in", "planar", "dexmart_index"} <= set(list_fingers())
    assert {"reversals", "stick_slip"} <= set(list_scenarios())
    assert all({**list_fingers(), **list_scenarios()}.values())


def test_fig6_is_the_papers_finger_with_the_published_friction_coefficient():
    finger = load_scenario("reversals").finger
    assert tuple(finger.joints) == ("abduction", "proximal", "medial", "distal")
    assert tuple(finger.tendons) == ("T1", "T2", "T3", "T4", "T5")
    assert finger.passive_names == ("T5",)
    assert [joint.link.length for joint in finger.joints.values()] == [0.0202, 0.045, 0.0299, 0.0218]


@pytest.mark.slow
@pytest.mark.parametrize("name", list_scenarios())
def test_the_resolved_text_of_a_scenario_reads_back_as_the_same_scenario(name, tmp_path):
    scenario = load_scenario(name, {"environment.fingertip_force": [0.1, 1 / 3, 1e-7]})
    path = tmp_path / "resolved.toml"
    path.write_text(to_toml(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario
    assert to_toml(load_scenario(path)) == to_toml(scenario)


def test_the_resolved_text_gives_the_same_trajectory_to_the_last_bit(tmp_path):
    (tmp_path / "s.toml").write_text(PLANAR)
    scenario = load_scenario(tmp_path / "s.toml", {"controller.gain": [1.0, 1 / 3]})
    (tmp_path / "resolved.toml").write_text(to_toml(scenario))
    first, second = fp.simulate(scenario), fp.simulate(load_scenario(tmp_path / "resolved.toml"))
    assert set(first) == set(second)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])


def test_the_resolved_text_stands_alone(tmp_path):
    scenario = load_scenario("reversals", {"finger.base": "dexmart_index"})
    table = tomllib.loads(to_toml(scenario))
    assert table["finger"]["joints"]["proximal"]["link"]["length"] == 0.038
    assert "base" not in table["finger"]
    assert "extends" not in table


def test_overrides_win_over_the_file(tmp_path):
    (tmp_path / "s.toml").write_text(PLANAR)
    scenario = load_scenario(tmp_path / "s.toml", {"simulation.duration": 3, "finger.gravity": [0, 0, 0]})
    assert scenario.simulation.duration == 3.0
    assert scenario.finger.gravity == (0.0, 0.0, 0.0)
    assert scenario.reference.joints["proximal"].offset == 0.6


@pytest.mark.parametrize("overrides", [["controller.gain"], "controller.gain=2", 2.0])
def test_overrides_that_are_no_mapping_are_refused(overrides):
    with pytest.raises(fp.InputError, match=r"overrides = .*: must be values by dotted key"):
        fp.load_scenario("reversals", overrides)


def test_a_joint_that_the_file_leaves_at_rest_may_be_moved_by_an_override(tmp_path):
    (tmp_path / "s.toml").write_text(PLANAR.replace("[reference.joints.distal]\noffset = 0.4\n", ""))
    key = "reference.joints.distal.offset"
    assert load_scenario(tmp_path / "s.toml", {key: 0.2}).reference.joints["distal"].offset == 0.2


def test_an_override_may_replace_the_finger_and_change_the_new_one_in_either_order():
    expected = load_finger("dexmart_index").joints["medial"].link.length
    for keys in (("finger.gravity", "finger"), ("finger", "finger.gravity")):
        values = {"finger": "dexmart_index", "finger.gravity": [1.0, 2.0, 3.0]}
        scenario = load_scenario("reversals", {key: values[key] for key in keys})
        assert scenario.finger.joints["medial"].link.length == expected
        assert scenario.finger.gravity == (1.0, 2.0, 3.0)


def test_an_override_of_a_hand_s_fingers_says_what_the_same_lines_in_a_file_say(tmp_path):
    path = tmp_path / "hand.toml"
    for lines, overrides in (
        ('thumb = "dexmart_index"', {"hand.fingers": {"thumb": "dexmart_index"}}),
        (
            'thumb = "ub_stand_in"\nindex = {scale = 1.2}',
            {"hand.fingers": {"thumb": "ub_stand_in"}, "hand.fingers.index": {"scale": 1.2}},
        ),
        (
            'thumb = {finger = {base = "ub_stand_in"}, scale = 2.0}',
            {"hand.fingers.thumb": {"finger": {"base": "ub_stand_in"}, "scale": 2}},
        ),
    ):
        path.write_text(f'extends = "hand"\nname = "hand"\n[hand.fingers]\n{lines}\n')
        assert load_scenario("hand", overrides) == load_scenario(path)
    for name, key in (("reversals", "hand.fingers.thumb.finger"), ("hand", "finger.gravity")):
        with pytest.raises(InputError, match=f"{key}: there is (one finger|a hand)"):
            load_scenario(name, {key: "ub_stand_in"})


def test_overrides_are_not_changed_by_loading():
    overrides = {
        "finger": {"base": "ub_stand_in", "joint_friction": {"viscous": 0.01}},
        "finger.joint_friction.stiffness": 7.0,
    }
    load_scenario("reversals", overrides)
    assert overrides["finger"] == {"base": "ub_stand_in", "joint_friction": {"viscous": 0.01}}
    assert len(overrides) == 2


def test_one_number_or_one_per_item_are_both_accepted_and_order_is_that_of_the_finger():
    scenario = load_scenario(
        "reversals", {"controller.gain": [1, 2, 3, 4], "finger.tendon_friction.coulomb": [0.1, 0.2, 0.3, 0.4, 0.5]}
    )
    assert scenario.controller.gain == (1.0, 2.0, 3.0, 4.0)
    assert scenario.finger.tendon_friction.coulomb == (0.1, 0.2, 0.3, 0.4, 0.5)
    assert scenario.controller.minimum_tension == 1.0


def test_a_scenario_extends_another_and_keeps_its_own_name(tmp_path):
    (tmp_path / "softer one.toml").write_text('extends = "reversals"\n[controller]\ngain = 0.5\n')
    scenario, base = load_scenario(tmp_path / "softer one.toml"), load_scenario("reversals")
    assert scenario.controller.gain == 0.5
    assert scenario.name == "softer_one"
    assert scenario.updated(controller=base.controller, name=base.name) == base


def test_extends_reaches_across_folders_and_generations(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "s.toml").write_text('extends = "reversals"\n[simulation]\nduration = 1.0\nrtol = 1e-5\n')
    (tmp_path / "inner" / "s.toml").write_text('extends = "../s.toml"\n[simulation]\nduration = 2.0\n')
    scenario = load_scenario(tmp_path / "inner" / "s.toml")
    assert (scenario.simulation.duration, scenario.simulation.rtol) == (2.0, 1e-5)


def test_a_circle_of_scenarios_is_an_error(tmp_path):
    (tmp_path / "a.toml").write_text('extends = "b.toml"\n')
    (tmp_path / "b.toml").write_text('extends = "./a.toml"\n')
    with pytest.raises(InputError, match=r"extends.*cannot start from itself"):
        load_scenario(tmp_path / "a.toml")


def test_a_finger_that_starts_from_itself_is_an_error(tmp_path):
    (tmp_path / "mine.toml").write_text('base = "mine.toml"\n')
    with pytest.raises(InputError, match=r"finger\.base.*cannot start from itself"):
        load_finger(tmp_path / "mine.toml")


def test_files_of_the_same_name_in_nested_folders_are_no_circle(tmp_path):
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (folder / "s.toml").write_text('extends = "../s.toml"\n')
    (tmp_path / "a" / "s.toml").write_text('extends = "../s.toml"\n')
    (tmp_path / "s.toml").write_text('extends = "reversals"\n[controller]\ngain = 0.25\n')
    assert load_scenario(folder / "s.toml").controller.gain == 0.25


def test_a_finger_is_changed_on_top_of_a_base(tmp_path):
    (tmp_path / "s.toml").write_text(
        'extends = "reversals"\n[finger]\nbase = "ub_stand_in"\n[finger.joints.distal.link]\nlength = 0.025\n'
    )
    finger, base = load_scenario(tmp_path / "s.toml").finger, load_finger("ub_stand_in")
    assert finger.joints["distal"].link.length == 0.025
    assert finger.joints["distal"].link.mass == base.joints["distal"].link.mass
    assert finger.joints["medial"] == base.joints["medial"]
    assert finger.name == "ub_stand_in"


def test_entries_of_finger_without_a_base_change_the_finger_of_the_parent(tmp_path):
    (tmp_path / "s.toml").write_text('extends = "reversals"\n[finger.tendon_friction]\ncoulomb = 0.2\n')
    finger, base = load_scenario(tmp_path / "s.toml").finger, load_finger("ub_stand_in")
    assert finger.tendon_friction.coulomb == 0.2
    assert finger.tendon_friction.stiffness == base.tendon_friction.stiffness
    assert finger.joints == base.joints


def test_a_finger_file_is_found_beside_the_scenario_that_names_it(tmp_path, monkeypatch):
    folder = tmp_path / "with space é"
    (folder / "fingers").mkdir(parents=True)
    (folder / "fingers" / "mine.toml").write_text(to_toml(load_finger("planar")).replace("0.0101", "0.0111"))
    (folder / "s.toml").write_text(PLANAR.replace('"planar"', '"fingers/mine.toml"'))
    monkeypatch.chdir(tmp_path)
    assert load_scenario("with space é/s.toml").finger.joints["proximal"].link.mass == 0.0111


def test_a_finger_file_in_an_override_is_found_from_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "s.toml").write_text(PLANAR)
    (tmp_path / "mine.toml").write_text('base = "planar"\ngravity = [0.0, 0.0, 0.0]\n')
    monkeypatch.chdir(tmp_path)
    for overrides in ({"finger": "mine.toml"}, {"finger.base": "mine.toml"}, {"finger": {"base": "./mine.toml"}}):
        assert load_scenario("scenarios/s.toml", overrides).finger.gravity == (0.0, 0.0, 0.0)


def test_load_finger_reads_a_file_and_takes_overrides(tmp_path):
    (tmp_path / "long one.toml").write_text('base = "planar"\n[joints.distal.link]\nlength = 0.04\n')
    finger = load_finger(tmp_path / "long one.toml", {"finger.joints.proximal.link.length": 0.05})
    assert [joint.link.length for joint in finger.joints.values()] == [0.05, 0.04]
    with pytest.raises(InputError, match=r"finger\.joints\.distal\.link\.lenth.*did you mean"):
        load_finger("planar", {"finger.joints.distal.link.lenth": 0.05})
    with pytest.raises(InputError, match="keys begin with finger"):
        load_finger("planar", {"controller.gain": 1.0})


def test_windows_line_ends_and_a_byte_order_mark_are_accepted(tmp_path):
    (tmp_path / "s.toml").write_bytes(b"\xef\xbb\xbf" + PLANAR.replace("\n", "\r\n").encode())
    assert load_scenario(tmp_path / "s.toml").finger.name == "planar"


@pytest.mark.parametrize(("stem", "name"), [("my run", "my_run"), ("2nd", "scenario_2nd"), ("é", "scenario__")])
def test_a_scenario_without_a_name_is_called_after_its_file_in_plain_letters(stem, name, tmp_path):
    path = tmp_path / f"{stem}.toml"
    path.write_text(PLANAR)
    assert load_scenario(path).name == name


def test_descriptions_are_printed_in_a_line():
    printed = [
        str(each) for each in (fp.load_scenario("reversals"), fp.load_scenario("hand"), fp.load_finger("ub_stand_in"))
    ]
    assert printed[0] == "<Scenario reversals: 8 s of <FingerDescription ub_stand_in: 4 joints, 5 tendons>>"
    assert "fingers thumb, index, middle, ring, little" in printed[1]
    assert max(map(len, printed)) < 120 and f"[{printed[2]}]" == repr([fp.load_finger("ub_stand_in")])


@pytest.mark.parametrize("finger", list_fingers())
@pytest.mark.parametrize("law", ["lugre", "dahl", "coulomb"])
def test_the_law_of_every_shipped_finger_switches_and_what_the_new_one_does_not_read_stays_behind(finger, law):
    switched = load_finger(finger, {"finger.joint_friction.law": law}).joint_friction
    assert switched.law == law and switched.coulomb == load_finger(finger).joint_friction.coulomb
    assert load_finger(finger, {"finger.joint_friction.viscous": 1.0, "finger.joint_friction.law": law})


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("scenario", "place", "choice", "value", "idle"),
    [
        ("reversals", "finger.joint_friction", "law", "coulomb", {"stiffness": 7.0}),
        ("reversals", "finger.joint_friction", "law", "dahl", {"stiction": 7e-4}),
        ("servo_position", "finger.actuators.M1", "drive", "tension", {"position_loop": {"proportional": 3.0}}),
    ],
)
def test_an_entry_that_the_chosen_kind_does_not_read_is_refused(tmp_path, order, scenario, place, choice, value, idle):
    (entry, number), file = *idle.items(), tmp_path / "s.toml"
    given = {f"{place}.{choice}": value, f"{place}.{entry}": number}
    assert load_scenario(scenario, {f"{place}.{choice}": value})
    with pytest.raises(InputError, match="has no effect"):
        load_scenario(scenario, dict([*given.items()][::order]))
    file.write_text(f"extends = '{scenario}'\n{place}.{choice} = '{value}'\n")
    assert load_scenario(file)
    number = number if isinstance(number, float) else "{ proportional = 3.0 }"
    file.write_text(f"{file.read_text()}{place}.{entry} = {number}\n")
    with pytest.raises(InputError, match="has no effect"):
        load_scenario(file)


def test_none_takes_away_any_entry_that_is_inherited(tmp_path):
    """What is left is what the base would be without the entry."""
    base, top = tmp_path / "base.toml", tmp_path / "top.toml"
    pull = "[controller.tensions]\nT3 = { kind = 'step', time = 0.0, height = 2.0 }\nT4 = { offset = 1.0 }\n"
    table = "name = 'top'\nfinger = 'ub_stand_in'\n[simulation]\nduration = 0.1\n"
    base.write_text(f"{table}rtol = 1e-3\n[controller]\nkind = 'tensions'\n{pull}")
    whole = tomllib.loads(base.read_text())
    for place in ("controller.tensions", "controller.tensions.T3", "simulation.rtol", "simulation"):
        left = tomllib.loads(base.read_text())
        *path, last = place.split(".")
        inner, named = left, whole
        for part in path:
            inner, named = inner[part], named[part]
        del inner[last]
        top.write_text(f"extends = 'base.toml'\n{place} = 'none'\n")
        expected = fp.description.loading.read_scenario(left)
        assert load_scenario(top) == expected == load_scenario(base, {"name": "top", place: "none"}), place
    for wrong in ("environment.fingertip_force_signal", "controller.sampling"):
        top.write_text(f"extends = 'base.toml'\n{wrong} = 'none'\n")
        with pytest.raises(InputError, match=f'{wrong} = "none"'):
            load_scenario(top)
    top.write_text("extends = 'hand'\n[hand.fingers]\nlittle = 'none'\n[reference]\njoints = 'none'\n")
    assert [*load_scenario(top).hand.fingers] == ["thumb", "index", "middle", "ring"]
