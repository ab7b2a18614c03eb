"""Input: what is accepted, how it is put together, and that every error names the entry that is wrong."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import list_fingers, list_scenarios, load_finger, load_scenario, to_toml
from finger_pin.exceptions import InputError

PLANAR = """
finger = "planar"
[reference.joints.proximal]
offset = 0.6
amplitude = -0.4
frequency = 0.5
phase = 1.5
[reference.joints.distal]
offset = 0.4
[simulation]
duration = 0.005
rtol = 1e-3
atol_scale = 1e-3
"""

# Every number of the interface: the key, whether it may be a list, and a value that is too small.
NUMBERS = [
    ("finger.tendon_friction.coulomb", True, -0.1),
    ("finger.tendon_friction.stiction_ratio", True, 0.9),
    ("finger.tendon_friction.stiffness", True, 0.0),
    ("finger.tendon_friction.viscous", True, -1.0),
    ("finger.tendon_friction.stribeck_velocity", True, 0.0),
    ("finger.joint_friction.coulomb", True, -1e-4),
    ("finger.joint_friction.stiction", True, -1e-4),
    ("finger.joint_friction.stiffness", True, 0.0),
    ("finger.joint_friction.viscous", True, -1e-3),
    ("finger.joint_friction.stribeck_velocity", True, 0.0),
    ("finger.passive_tendon.stiffness", True, 0.0),
    ("finger.passive_tendon.mass", True, -8.8e-6),
    ("finger.stroke_limiter.stiffness", True, -50.0),
    ("finger.stroke_limiter.damping", True, -0.5),
    ("finger.joints.proximal.link.mass", False, -0.01),
    ("finger.joints.proximal.link.length", False, 0.0),
    ("finger.joints.proximal.link.width", False, -0.017),
    ("finger.tendons.T1.curvature_offset", False, -1.0),
    ("controller.gain", True, -1.0),
    ("controller.minimum_tension", True, -1.0),
    ("controller.passive_tension", True, -1.0),
    ("reference.joints.medial.frequency", False, -1.0),
    ("simulation.duration", False, 0.0),
    ("simulation.sample_rate", False, 0.0),
    ("simulation.rtol", False, 0.0),
    ("simulation.atol_scale", False, -1e-6),
]

# A command line's --set on the scenario fig6, the entry that the message begins with, and what it says.
NUMBER_OVERRIDES = [
    *((f"{key}={small}", key, ("must be above", "must be at least")) for key, _, small in NUMBERS),
    *((f"{key}=nan", key, "must be a finite number") for key, _, _ in NUMBERS),
    *((f"{key}=-inf", key, "must be a finite number") for key, _, _ in NUMBERS),
    *((f'{key}="1.0"', key, "must be a number") for key, _, _ in NUMBERS),
    *((f"{key}=true", key, "must be a number") for key, _, _ in NUMBERS),
    *((f"{key}={{a = 1}}", key, "must be a number") for key, _, _ in NUMBERS),
    *((f"{key}=1979-05-27", key, "must be a number") for key, _, _ in NUMBERS),
    *((f"{key}=[]", key, "must be a number") for key, _, _ in NUMBERS),
    *((f"{key}=[{', '.join(['1.0'] * 7)}]", key, ("7", "one per", "must be")) for key, many, _ in NUMBERS if many),
    *((f"{key}=[1.0]", key, "must be a number") for key, many, _ in NUMBERS if not many),
    *((f"{key}={10**400}", key, "must be a finite number") for key, _, _ in NUMBERS),
    *((f"{key}y=1.0", f"{key}y", f"did you mean {key}?") for key, _, _ in NUMBERS),
]
OTHER_OVERRIDES = [
    # Vectors.
    ("finger.gravity=9.81", "finger.gravity", "must be a list of 3 numbers"),
    ("finger.gravity=[0.0, -9.81]", "finger.gravity", "must be a list of 3 numbers"),
    ("finger.gravity=[0.0, 0.0, 0.0, -9.81]", "finger.gravity", "must be a list of 3 numbers"),
    ('finger.gravity=[0.0, 0.0, "g"]', "finger.gravity[2]", "must be a number"),
    ("finger.gravity=[0.0, nan, 0.0]", "finger.gravity[1]", "must be a finite number"),
    ("environment.fingertip_force=1.0", "environment.fingertip_force", "must be a list of 3 numbers"),
    ("environment.fingertip_force=[1, 2]", "environment.fingertip_force", "must be a list of 3 numbers"),
    ("environment.fingertip_force=[1, 2, [3]]", "environment.fingertip_force[2]", "must be a number"),
    ("environment.fingertip_force=[inf, 0, 0]", "environment.fingertip_force[0]", "must be a finite number"),
    # Lists of the wrong size say whose they are.
    ("controller.gain=[1.0, 2.0]", "controller.gain", "list of 4, one per joint (abduction, proximal, medial, distal)"),
    ("controller.gain=[1.0, 2.0, 3.0, -4.0]", "controller.gain[3]", "at least 0"),
    ("controller.minimum_tension=[1.0, 2.0]", "controller.minimum_tension", "list of 5, one per tendon (T1, T2, T3"),
    ("controller.passive_tension=[1.0, 2.0]", "controller.passive_tension", "list of 1, one per passive tendon (T5)"),
    ("finger.passive_tendon.mass=[1e-5, 1e-5]", "finger.passive_tendon.mass", "list of 1, one per passive tendon (T5)"),
    ("finger.joint_friction.viscous=[1e-3]", "finger.joint_friction.viscous", "list of 4"),
    # Physics.
    ("finger.joint_friction.stiction=2e-4", "finger.joint_friction.stiction", "Coulomb coefficient 0.00025"),
    (
        "finger.joint_friction.stiction=[4e-4, 4e-4, 1e-4, 4e-4]",
        "finger.joint_friction.stiction",
        "= [0.0004, 0.0004, 0.0001, 0.0004]: must be at least the Coulomb coefficient",
    ),
    ("finger.joint_friction.coulomb=4e-4", "finger.joint_friction.stiction", "Coulomb coefficient 0.0004"),
    ("finger.joints.medial.range=[1.0, 0.0]", "finger.joints.medial.range", "lower limit must be below"),
    ("finger.joints.medial.range=[0.5, 0.5]", "finger.joints.medial.range", "lower limit must be below"),
    ("finger.joints.medial.range=1.5", "finger.joints.medial.range", "must be a list of 2 numbers"),
    ("finger.joints.medial.range=[0.0, 1.0, 2.0]", "finger.joints.medial.range", "must be a list of 2 numbers"),
    ("finger.joints.medial.link.mass=0", "finger.joints.medial.link.mass", "must be above 0"),
    ("finger.joints.medial.link.length=45", "finger.joints.medial.link.length", "millimetres"),
    ("finger.joints.medial.link.twist=90", "finger.joints.medial.link.twist", "degrees"),
    ("finger.joints.distal.range=[0, 90]", "finger.joints.distal.range[1]", "degrees"),
    ("finger.joints.distal.range=[-90, 0]", "finger.joints.distal.range[0]", "degrees"),
    ("reference.joints.medial.offset=-35", "reference.joints.medial.offset", "degrees"),
    ("reference.joints.medial.amplitude=25", "reference.joints.medial.amplitude", "degrees"),
    ("finger.joints.medial.link.mass=500", "finger.joints.medial.link.mass", "grams"),
    ("finger.joints.medial.link.axial_inertia=1.0", "finger.joints.medial.link.axial_inertia", "at most twice"),
    ("finger.joints.medial.link.section=hexagon", "finger.joints.medial.link.section", "round, square"),
    ("finger.joints.medial.link.section=squared", "finger.joints.medial.link.section", "did you mean square?"),
    ("finger.joints.medial.link=3", "finger.joints.medial.link", "must be a table"),
    ("finger.tendons.T1.kind=active", "finger.tendons.T1.kind", "actuated, passive"),
    ("finger.tendons.T1.kind=pasive", "finger.tendons.T1.kind", "did you mean passive?"),
    ("finger.tendons.T1.mass_after=1", "finger.tendons.T1.mass_after", "passive tendons only"),
    ("finger.tendons.T5.mass_after=3", "finger.tendons.T5.mass_after", "at most the 2 crossings"),
    ("finger.tendons.T5.mass_after=-1", "finger.tendons.T5.mass_after", "at least 0"),
    ("finger.tendons.T5.mass_after=1.5", "finger.tendons.T5.mass_after", "whole number"),
    ("finger.tendons.T1.crossings.proximal={}", "finger.tendons.T1.crossings.proximal.radius", "is missing"),
    ("finger.tendons.T1.crossings.proximal=0.01", "finger.tendons.T1.crossings.proximal", "must be a table"),
    ("finger.tendons.T1.crossings.abduction.bends=1", "finger.tendons.T1.crossings.abduction.bends", "true or false"),
    ("finger.tendons.T1.crossings.abduction.radius=8", "finger.tendons.T1.crossings.abduction.radius", "millimetres"),
    ("finger.tendons.T1.crossings={}", "finger.tendons.T1.crossings", "at least one entry"),
    ("finger.tendons.T4.crossings.medial.radius=0.0053", "finger.tendons", "force closure"),
    ("finger.tendons.T2.crossings={distal = {radius = 0.0}}", "finger.tendons.T2.crossings", "differ from zero"),
    (
        'finger.tendons.T4={kind = "passive", crossings = {medial = {radius = 0.004}, distal = {radius = -0.004}}}',
        "finger.tendons",
        ("determine the same joint twice", "force closure"),
    ),
    # Nothing comes into being.
    ("finger.tendons.t3.curvature_offset=1", "finger.tendons.t3", "there are T1, T2, T3, T4, T5; did you mean T3?"),
    ("finger.tendons.T33.crossings.medial.radius=0.01", "finger.tendons.T33", "no such tendon"),
    ("finger.tendons.T6={crossings = {distal = {radius = 0.01}}}", "finger.tendons.T6", "no such tendon"),
    ("finger.tendons.T1.crossings.thumb={radius = 0.01}", "finger.tendons.T1.crossings.thumb", "no such crossing"),
    ("finger.tendons.T3.crossings.mediale.radius=0.01", "finger.tendons.T3.crossings.mediale", "did you mean medial?"),
    ("finger.joints.thumb={}", "finger.joints.thumb", "no such joint; there are abduction"),
    ("reference.joints.proximl.offset=0.1", "reference.joints.proximl", "did you mean proximal?"),
    ("finger.joints={}", "finger.joints", "at least one entry"),
    ("finger.tendons={}", "finger.tendons", "at least one entry"),
    ("reference.joints.thumb={offset = 0.1}", "reference.joints.thumb", "no such joint; there are abduction"),
    ("reference.joints.distal={offset = 0.1}", "reference.joints.distal", "passive tendon"),
    ("reference.joints.medial=0.5", "reference.joints.medial", "must be a table"),
    ("reference.joints=[1.0]", "reference.joints", "must be a table"),
    ("simulation.sample_rate=1e7", "simulation.sample_rate", "samples"),
    ("simulation.duration=1e9", "simulation.duration", "at most"),
    ("simulation.rtol=1.0", "simulation.rtol", "at most 0.1"),
    # Names.
    ("finger=plannar", "finger", "did you mean planar?"),
    ("finger=nothing_like_it", "finger", "dexmart_index, planar, ub"),
    ("finger=../fingers/ub", "finger file", "no such file"),
    ("finger=../../etc/passwd.toml", "finger file", "no such file"),
    ("finger=my_finger.toml", "finger file", "no such file"),
    ('finger="ub\\u0000"', "finger", "no such finger"),
    (f"finger={'x' * 400}", "finger", "no such finger"),
    (f"finger={'x' * 400}.toml", "finger file", "cannot be read"),
    ('finger="a\\u0000b.toml"', "finger file", "cannot be read"),
    ("finger=3", "finger", "name of a finger"),
    ('finger=["ub"]', "finger", "name of a finger"),
    ("finger={}", "finger.name", "is missing"),
    ("finger={base = 3}", "finger.base", "name or path"),
    ('finger={base = "planr"}', "finger", "did you mean planar?"),
    ("finger.base=dexmart", "finger", "did you mean dexmart_index?"),
    ("simulation.method=RK45", "simulation.method", "must be one of"),
    ("simulation.method=radaux", "simulation.method", "did you mean Radau?"),
    ("simulation.method=5", "simulation.method", "must be one of"),
    ('simulation.method=["Radau"]', "simulation.method", "must be one of"),
    ("controller.kind=proportionl", "controller.kind", "did you mean proportional?"),
    ('name="a b"', "name", "letters, digits and underscores"),
    ('name="../up"', "name", "letters, digits and underscores"),
    ('name="/etc/passwd"', "name", "letters, digits and underscores"),
    ('name=""', "name", "letters, digits and underscores"),
    ("name=7", "name", "must be a string"),
    (f"name={'n' * 100}", "name", "too long"),
    ("title=7", "title", "must be a string"),
    # Keys.
    ("controler.gain=2", "controler.gain", "did you mean controller.gain?"),
    ("gain=2", "gain", "keys begin with controller, environment, finger"),
    ("zzz=2", "zzz", "unknown key"),
    ("Controller.gain=2", "Controller.gain", "did you mean controller.gain?"),
    ("controller.Gain=2", "controller.Gain", "did you mean controller.gain?"),
    ("controller.gain.proximal=2", "controller.gain.proximal", "controller.gain has no entries"),
    ("controller..gain=2", "controller.", "unknown key"),
    (".gain=2", ".gain", "unknown key"),
    ("controller.=2", "controller.", "unknown key"),
    ("controller=2", "controller", "must be a table"),
    ("simulation=[]", "simulation", "must be a table"),
    ("finger.joint_friction=1", "finger.joint_friction", "must be a table"),
    ("finger.tendon_friction.coulomb_=1", "finger.tendon_friction.coulomb_", "finger.tendon_friction.coulomb?"),
    ("finger.joints.proximal.lnk.mass=1", "finger.joints.proximal.lnk", "finger.joints.proximal.link?"),
    ("finger.joints.proximl.link.mass=1", "finger.joints.proximl", "did you mean proximal?"),
]
OVERRIDES = NUMBER_OVERRIDES + OTHER_OVERRIDES

DEEP = 5000
# The bytes of a scenario file, what the message names, and what it says.
FILES = {
    "empty": (b"", "finger", "is missing"),
    "only a comment": (b"# nothing\n", "finger", "is missing"),
    "no equals sign": (b"finger\n", "is not valid TOML", "line 1"),
    "an open string": (b'finger = "ub\n', "is not valid TOML", "line 1"),
    "an open table": (b"[finger\n", "is not valid TOML", "line 1"),
    "an open list": (b'finger = "ub"\n[controller]\ngain = [1, 2\n', "is not valid TOML", "end of document"),
    "a value without quotes": (b"finger = ub\n", "is not valid TOML", "line 1"),
    "a key twice": (b'finger = "ub"\nfinger = "planar"\n', "is not valid TOML", "line 2"),
    "a table twice": (b'finger = "ub"\n[controller]\n[controller]\n', "is not valid TOML", "line 3"),
    "binary": (bytes(range(256)), "scenario file", "UTF-8"),
    "an image": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", "scenario file", "UTF-8"),
    "UTF-16": ('finger = "ub"'.encode("utf-16"), "scenario file", "UTF-8"),
    "Latin-1": ('title = "é"'.encode("latin-1"), "scenario file", "UTF-8"),
    "zero bytes": (b"\0" * 100, "is not valid TOML", "line 1"),
    "JSON": (b'{"finger": "ub"}', "is not valid TOML", "line 1"),
    "deep lists": (b"finger = " + b"[" * DEEP + b"]" * DEEP, "scenario", "nested too deeply"),
    "deep tables": (b"finger = " + b"{a=" * DEEP + b"1" + b"}" * DEEP, "scenario", "nested too deeply"),
    "a deep key": (b'finger = "ub"\n' + b"a." * DEEP + b"a = 1", "a", "unknown key"),
    "a long integer": (b'finger = "ub"\n[controller]\ngain = ' + b"9" * 5000, "is not valid TOML", "digits"),
    "a long hexadecimal": (b'finger = "ub"\n[controller]\ngain = 0x' + b"f" * 5000, "controller.gain", "6021 digits"),
    "a large float": (b'finger = "ub"\n[controller]\ngain = 1e999', "controller.gain", "finite"),
    "a key with a line break": (b'finger = "ub"\n"a\\nb" = 1', "a\\nb", "unknown key"),
    "a long key": (b'finger = "ub"\n' + b"k" * 10_000 + b" = 1", "kkk...", "unknown key"),
    "a list of tables": (b'finger = "ub"\n[[controller]]\ngain = 1', "controller", "must be a table"),
    "a misspelt section": (b'finger = "ub"\n[simulatoin]\nduration = 1', "simulatoin", "did you mean simulation?"),
    "a misspelt extends": (b'extend = "fig6"\nfinger = "ub"', "extend", "did you mean extends?"),
    "a missing parent": (b'extends = "fig7"', "scenario", "did you mean fig6?"),
    "a missing parent file": (b'extends = "other.toml"', "scenario file other.toml", "no such file"),
    "a parent that is a number": (b"extends = 6", "extends", "name or path"),
    "a parent that is a folder": (b'extends = "./"', "scenario file ./", "cannot be read"),
    "its own parent": (b'extends = "case.toml"', "extends", "cannot start from itself"),
    "a finger under a wrong key": (b'[fingre]\nbase = "ub"', "finger", "is missing"),
    "a finger without joints": (b'[finger]\nname = "f"', "finger.joints", "is missing"),
    "a finger's unknown key": (b'[finger]\nbase = "ub"\nmass = 1', "finger.mass", "unknown key"),
    "a finger's misspelt base": (b'[finger]\nbse = "ub"', "finger.bse", "did you mean finger.base?"),
    "a joint name with a space": (
        b'[finger]\nbase = "ub"\n[finger.joints."a b"]\nrange = [0.0, 1.0]',
        "finger.joints.a b",
        "letters, digits and underscores",
    ),
    "a missing length": (
        b'[finger]\nname = "f"\n[finger.joints.a]\nrange = [0.0, 1.0]\n[finger.joints.a.link]\nwidth = 0.01\n'
        b"mass = 0.01\n[finger.tendons.T1.crossings.a]\nradius = 0.01",
        "finger.joints.a.link.length",
        "is missing",
    ),
    "too few tendons": (
        b'[finger]\nname = "f"\n[finger.joints.a]\nrange = [0.0, 1.0]\n[finger.tendons.T1.crossings.a]\nradius = 0.01',
        "finger.tendons",
        "force closure",
    ),
}


def load_overridden(text):
    key, _, value = text.partition("=")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value
    return load_scenario("fig6", {key: parsed})


@pytest.mark.parametrize(("text", "entry", "says"), OVERRIDES, ids=[text[:60] for text, _, _ in OVERRIDES])
def test_a_wrong_override_is_an_error_of_one_line_that_names_the_entry(text, entry, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        load_overridden(text)
    message = str(caught.value)
    assert message.startswith(entry)
    assert any(each in message for each in ((says,) if isinstance(says, str) else says)), message
    assert message.isprintable()
    assert len(message) < 600


@pytest.mark.parametrize("case", FILES)
def test_a_wrong_file_is_an_error_of_one_line_that_names_the_entry(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data, names, says = FILES[case]
    Path("case.toml").write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_scenario("case.toml")
    message = str(caught.value)
    assert names in message
    assert says in message
    assert message.isprintable()
    assert len(message) < 600


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("", "no such scenario"),
        ("fig8", "did you mean fig6?"),
        ("FIG6", "did you mean fig6?"),
        ("stickslip", "did you mean stick_slip?"),
        ("absent.toml", "no such file"),
        ("no/such/folder/s.toml", "no such file"),
        ("../fig6", "no such file"),
        ("/", "cannot be read"),
        (".", "no such scenario"),
        ("~nobody_of_this_name/s.toml", "no such file"),
        ("x\0.toml", "cannot be read"),
        ("n" * 5000 + ".toml", "cannot be read"),
        ("/dev/zero", "is larger than"),
    ],
)
def test_a_scenario_that_cannot_be_found_is_an_error_that_says_why(name, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="scenario") as caught:
        load_scenario(name)
    assert says in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_file_that_may_not_be_read_is_an_error_that_names_it(tmp_path, monkeypatch):
    path = tmp_path / "secret.toml"
    path.write_text(PLANAR)

    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("builtins.open", refuse)
    with pytest.raises(InputError, match=r"secret\.toml: cannot be read: Permission denied"):
        load_scenario(path)


def test_of_a_misspelt_key_and_the_entry_that_it_leaves_missing_the_misspelt_key_is_named():
    finger = tomllib.loads(to_toml(load_finger("ub")))
    finger["joints"]["medial"]["link"]["lenght"] = finger["joints"]["medial"]["link"].pop("length")
    with pytest.raises(InputError, match=r"did you mean finger\.joints\.medial\.link\.length"):
        load_scenario("fig6", {"finger": finger})


def test_an_input_error_carries_entry_value_and_what_is_allowed():
    with pytest.raises(InputError) as caught:
        load_scenario("fig6", {"controller.gain": -2.0})
    assert caught.value.entry == "controller.gain"
    assert caught.value.value == -2.0
    assert "at least 0" in caught.value.allowed
    assert isinstance(caught.value, ValueError)


def test_values_in_messages_are_written_as_in_toml():
    for value, text in (
        (["a", True, [1, 2.5], {"b": 1}], '["a", true, [1, 2.5], { ... }]'),
        ((1.0, 2.0), "[1.0, 2.0]"),
        ("two\nlines", '"two\\nlines"'),
        (False, "false"),
    ):
        with pytest.raises(InputError) as caught:
            load_scenario("fig6", {"finger.gravity": value})
        assert str(caught.value).startswith(f"finger.gravity = {text}: ")


@pytest.mark.parametrize("name", list_scenarios())
def test_every_shipped_scenario_loads(name):
    assert load_scenario(name).name == name


@pytest.mark.parametrize("name", list_fingers())
def test_every_shipped_finger_loads(name):
    assert load_finger(name).name == name


def test_listings_have_a_line_about_each():
    assert {"ub", "planar", "dexmart_index"} <= set(list_fingers())
    assert {"fig6", "stick_slip"} <= set(list_scenarios())
    assert all({**list_fingers(), **list_scenarios()}.values())


def test_fig6_is_the_papers_finger_with_the_published_friction_coefficient():
    finger = load_scenario("fig6").finger
    assert tuple(finger.joints) == ("abduction", "proximal", "medial", "distal")
    assert tuple(finger.tendons) == ("T1", "T2", "T3", "T4", "T5")
    assert finger.passive_names == ("T5",)
    assert [joint.link.length for joint in finger.joints.values()] == [0.0202, 0.045, 0.0299, 0.0218]


@pytest.mark.parametrize("name", list_scenarios())
def test_the_resolved_text_of_a_scenario_reads_back_as_the_same_scenario(name, tmp_path):
    scenario = load_scenario(name, {"controller.gain": [0.1, 1 / 3, 2, 1e-7]})
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
    scenario = load_scenario("fig6", {"finger.base": "dexmart_index"})
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


def test_a_joint_that_the_file_leaves_at_rest_may_be_moved_by_an_override(tmp_path):
    (tmp_path / "s.toml").write_text(PLANAR.replace("[reference.joints.distal]\noffset = 0.4\n", ""))
    key = "reference.joints.distal.offset"
    assert load_scenario(tmp_path / "s.toml", {key: 0.2}).reference.joints["distal"].offset == 0.2


def test_an_override_may_replace_the_finger_and_change_the_new_one_in_either_order():
    expected = load_finger("dexmart_index").joints["medial"].link.length
    for keys in (("finger.gravity", "finger"), ("finger", "finger.gravity")):
        values = {"finger": "dexmart_index", "finger.gravity": [1.0, 2.0, 3.0]}
        scenario = load_scenario("fig6", {key: values[key] for key in keys})
        assert scenario.finger.joints["medial"].link.length == expected
        assert scenario.finger.gravity == (1.0, 2.0, 3.0)


def test_overrides_are_not_changed_by_loading():
    overrides = {"finger": {"base": "ub", "joint_friction": {"viscous": 0.01}}, "finger.joint_friction.stiffness": 7.0}
    load_scenario("fig6", overrides)
    assert overrides["finger"] == {"base": "ub", "joint_friction": {"viscous": 0.01}}
    assert len(overrides) == 2


def test_one_number_or_one_per_item_are_both_accepted_and_order_is_that_of_the_finger():
    scenario = load_scenario(
        "fig6", {"controller.gain": [1, 2, 3, 4], "finger.tendon_friction.coulomb": [0.1, 0.2, 0.3, 0.4, 0.5]}
    )
    assert scenario.controller.gain == (1.0, 2.0, 3.0, 4.0)
    assert scenario.finger.tendon_friction.coulomb == (0.1, 0.2, 0.3, 0.4, 0.5)
    assert scenario.controller.minimum_tension == 1.0


def test_a_scenario_extends_another_and_keeps_its_own_name(tmp_path):
    (tmp_path / "softer one.toml").write_text('extends = "fig6"\n[controller]\ngain = 0.5\n')
    scenario, base = load_scenario(tmp_path / "softer one.toml"), load_scenario("fig6")
    assert scenario.controller.gain == 0.5
    assert scenario.name == "softer_one"
    assert scenario.model_copy(update={"controller": base.controller, "name": base.name}) == base


def test_extends_reaches_across_folders_and_generations(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "s.toml").write_text('extends = "fig6"\n[simulation]\nduration = 1.0\nrtol = 1e-5\n')
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
    (tmp_path / "s.toml").write_text('extends = "fig6"\n[controller]\ngain = 0.25\n')
    assert load_scenario(folder / "s.toml").controller.gain == 0.25


def test_a_finger_is_changed_on_top_of_a_base(tmp_path):
    (tmp_path / "s.toml").write_text(
        'extends = "fig6"\n[finger]\nbase = "ub"\n[finger.joints.distal.link]\nlength = 0.025\n'
    )
    finger, base = load_scenario(tmp_path / "s.toml").finger, load_finger("ub")
    assert finger.joints["distal"].link.length == 0.025
    assert finger.joints["distal"].link.mass == base.joints["distal"].link.mass
    assert finger.joints["medial"] == base.joints["medial"]
    assert finger.name == "ub"


def test_entries_of_finger_without_a_base_change_the_finger_of_the_parent(tmp_path):
    (tmp_path / "s.toml").write_text('extends = "fig6"\n[finger.tendon_friction]\ncoulomb = 0.2\n')
    finger, base = load_scenario(tmp_path / "s.toml").finger, load_finger("ub")
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
