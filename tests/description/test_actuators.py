"""Actuators as data: what ships, motors of one's own, and every mistake in one line."""

import pytest

import finger_pin as fp
from finger_pin.description.loading import load_finger, load_scenario
from finger_pin.description.tables import list_motors
from finger_pin.exceptions import InputError

SPOOL = {"motor": "XL330-M288", "tendons": ["T1"], "spool_radius": 0.005}
SHEET = {"stall_torque": 0.93, "stall_current": 1.8, "no_load_speed": 8.482}
OWN = {"voltage": 5.0, "maximum_current": 1.8, "inertia": 1e-3}
FITTED = {**OWN, "torque_constant": 0.4, "resistance": 3.0, "friction": {"coulomb": 0.01}}

#: Actuators that are wrong, which entry the message names, and what it says.
WRONG = {
    "no spool": ({"M": {k: v for k, v in SPOOL.items() if k != "spool_radius"}}, "M.spool_radius", "is missing"),
    "no motor": ({"M": {"tendons": ["T1"], "spool_radius": 0.005}}, "M.motor", "is missing"),
    "unknown motor": ({"M": {**SPOOL, "motor": "XL330-M28"}}, "M.motor", "did you mean XL330-M288?"),
    "millimetres": ({"M": {**SPOOL, "spool_radius": 5.0}}, "M.spool_radius", "is it in millimetres?"),
    "no encoder": ({"M": {**SPOOL, "motor": FITTED, "drive": "position"}}, "M.motor.encoder.range", "is missing"),
    "negative inertia": ({"M": {**SPOOL, "motor": {**FITTED, "inertia": -1e-3}}}, "M.motor.inertia", "must be above 0"),
    "both constants": (
        {"M": {**SPOOL, "motor": {**FITTED, "data_sheet": SHEET}}},
        "M.motor.torque_constant",
        "leave one of the two out",
    ),
    "no constants": ({"M": {**SPOOL, "motor": OWN}}, "M.motor.torque_constant", "or a data_sheet"),
    "impossible sheet": (
        {"M": {**SPOOL, "motor": {**OWN, "data_sheet": {**SHEET, "stall_torque": 1.2}}}},
        "M.motor.data_sheet.stall_torque",
        "must be at most",
    ),
    "two actuators": ({"M": SPOOL, "N": SPOOL}, "N.tendons", "T1 has two sources: M pulls it already"),
    "passive tendon": ({"M": {**SPOOL, "tendons": ["T5"]}}, "M.tendons", "T5 is passive"),
    "unknown tendon": ({"M": {**SPOOL, "tendons": ["T7"]}}, "M.tendons", "actuated are T1, T2, T3, T4"),
    "twice": ({"M": {**SPOOL, "tendons": ["T1", "T1"], "drive": "position"}}, "M.tendons", "must be different tendons"),
    "negative radius": (
        {"M": {**SPOOL, "tendons": ["T1", "T2"], "spool_radius": [0.005, -0.005], "drive": "position"}},
        "M.spool_radius = [0.005, -0.005]",
        'winds = ["in", "in"] winds all in together',
    ),
    "three tendons": (
        {"M": {**SPOOL, "tendons": ["T1", "T2", "T3"], "drive": "position"}},
        "M.winds",
        'winds = ["in", "in", "in"] winds all in together',
    ),
    "first paid out": (
        {"M": {**SPOOL, "tendons": ["T1", "T2"], "winds": ["out", "in"], "drive": "position"}},
        "M.winds",
        '"in" for the first',
    ),
    "let go in tension": (
        {"M": {**SPOOL, "position_loop": {"torque_off": 1.0}}},
        "M.position_loop.torque_off",
        "commands of 0 N",
    ),
    "one word less": (
        {"M": {**SPOOL, "tendons": ["T1", "T2"], "winds": ["in"], "drive": "position"}},
        "M.winds",
        "for each of T1, T2",
    ),
    "two in tension": ({"M": {**SPOOL, "tendons": ["T1", "T2"]}}, "M.drive", 'has drive = "position"'),
    "one radius more": ({"M": {**SPOOL, "spool_radius": [0.005, 0.004]}}, "M.spool_radius", "one per tendon: T1"),
    "unknown drive": ({"M": {**SPOOL, "drive": "speed"}}, "M.drive", "tension, position"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_actuator_is_an_error_of_one_line_that_names_the_entry(case):
    actuators, entry, says = WRONG[case]
    with pytest.raises(InputError) as caught:
        load_finger("ub_stand_in", {"finger.actuators": actuators})
    message = str(caught.value)
    assert message.startswith(f"finger.actuators.{entry}") and says in message
    assert "\n" not in message


def test_a_finger_alone_refuses_a_winch_and_an_end_of_tension_beside_a_motor():
    for entry, value in (("winch", {"pieces": 2}), ("maximum_tension", 30.0)):
        with pytest.raises(InputError, match=rf"^finger\.tendons\.T1\.{entry}.*actuators\.M pulls it"):
            load_finger("ub_stand_in", {"finger.actuators": {"M": SPOOL}, f"finger.tendons.T1.{entry}": value})


def test_winches_and_spools_of_the_same_numbers_have_the_same_cords():
    """K = E A / L_0 = 4500 N / 0.3 m, and e0 = T_0 / K."""
    winch = {"stiffness": 15000.0, "damping": 7.0, "pieces": 3}
    spool = {"tendons": ["T1", "T2"], "winds": ["in", "in"], "drive": "position", "tendon_rigidity": [4500.0, 9000.0]}
    spool |= {"tendon_damping": 7.0, "tendon_pieces": [3, 0], "tendon_hysteresis": [0.0, 0.1], "pretension": [0.0, 3.0]}
    tables = {"finger.actuators": {"M": SPOOL | spool}, "finger.tendons.T3.winch": winch}
    cords = load_finger("ub_stand_in", tables).drive_cords
    assert list(cords) == ["T3", "T1", "T2"] and cords["T1"] == cords["T3"] == (15000.0, 7.0, 3, 0.0, 0.0)
    assert cords["T2"] == pytest.approx((30000.0, 7.0, 0, 0.1, 1e-4), rel=1e-14)


def test_a_motor_that_starts_from_itself_is_named(tmp_path):
    (tmp_path / "one.toml").write_text('base = "other.toml"\n')
    (tmp_path / "other.toml").write_text('base = "one.toml"\n')
    (tmp_path / "run.toml").write_text('extends = "servo"\nfinger.actuators.M1.motor = "one.toml"\n')
    with pytest.raises(InputError, match=r'finger\.actuators\.M1\.motor = "one\.toml": a motor cannot start from it'):
        load_scenario(tmp_path / "run.toml")


def test_a_current_limit_below_what_pretension_needs_is_named_with_what_it_needs():
    """T3 has 4.32 times the tension of T1: 5 mm x 4.32 x 40 N = 0.864 N m take 2.24 A."""
    with pytest.raises(InputError) as caught:
        load_scenario("servo", {"controller.minimum_tension": 40.0, "finger.actuators.*.motor.maximum_current": 1.2})
    assert str(caught.value).startswith(
        "finger.actuators.M3.motor.maximum_current = 1.2: pretension alone needs 2.24 A"
    )
    # Standing, the supply drives no more than V / R = 1.469 A.
    with pytest.raises(InputError, match=r"^finger.actuators.M3.motor.voltage = 5.0: pretension alone needs 7.61 V"):
        load_scenario("servo", {"controller.minimum_tension": 40.0, "finger.actuators.*.motor.maximum_current": 9.0})


def test_a_tendon_whose_spool_is_held_cannot_be_given_tensions_too():
    tensions = {
        "controller.kind": "tensions",
        "controller.tensions": {"T2": {"offset": 2.0}},
        "controller.damping": 0.0,
    }
    with pytest.raises(InputError, match=r"^controller.tensions.T2: has two sources: finger.actuators.M2 holds"):
        load_scenario("servo_position", tensions)
    assert load_scenario("servo", tensions).controller.tensions


@pytest.mark.parametrize(
    "entry, value, says",
    [
        ("finger.actuators.M4.motor.encoder.range", [-2.0, 2.0], "the motion takes the spool from"),
        ("finger.actuators.M2.position_loop.period", 2e-3, "must be that of the others, 0.001 s"),
        ("simulation.method", "Radau", "a position drive is sampled: one of Rodas5P, Rodas4"),
    ],
)
def test_a_position_drive_that_cannot_be_simulated_says_why(entry, value, says):
    with pytest.raises(InputError) as caught:
        fp.simulate(load_scenario("servo_position", {entry: value}))
    assert str(caught.value).startswith(f"{entry} = ") and says in str(caught.value)


def test_every_motor_ships_with_a_title_and_can_pull():
    assert set(list_motors()) == {"STS3215", "XC330-M288", "XL330-M288"} and all(list_motors().values())
    for name in list_motors():
        motor = load_finger("ub_stand_in", {"finger.actuators": {"M": {**SPOOL, "motor": name}}}).actuators["M"].motor
        assert all(number > 0.0 for number in motor.constants)


def test_a_motor_can_be_a_file_a_table_on_a_base_or_overridden(tmp_path):
    (tmp_path / "mine.toml").write_text('base = "XL330-M288"\ninertia = 2e-3\n')
    (tmp_path / "run.toml").write_text(
        'extends = "servo"\n[finger.actuators.M1]\nmotor = "./mine.toml"\n'
        '[finger.actuators.M2]\nmotor = { base = "STS3215", inertia = 3e-2 }\n'
    )
    loaded = load_scenario(tmp_path / "run.toml", {"finger.actuators.M3.motor": "XC330-M288"}).finger.actuators
    assert [each.motor.inertia for each in loaded.values()] == [2e-3, 3e-2, 1.9e-3, 1.895e-3]
    assert loaded["M1"].motor.torque_constant == 0.3862 and loaded["M2"].motor.voltage == 7.4
    # A star stands for every actuator.
    starred = load_scenario("servo", {"finger.actuators.*.motor": "STS3215", "finger.actuators.*.motor.inertia": 0.02})
    assert {each.motor.inertia for each in starred.finger.actuators.values()} == {0.02}


def test_the_written_scenario_needs_no_table_of_motors_and_reads_back_the_same(tmp_path):
    scenario = load_scenario("servo", {"finger.actuators.M3.motor": "XC330-M288"})
    (tmp_path / "again.toml").write_text(fp.to_toml(scenario))
    assert load_scenario(tmp_path / "again.toml") == scenario
