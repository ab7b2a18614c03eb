"""Wrong input: one line that names the entry, the value, what is allowed and the nearest valid name."""

import tomllib
from pathlib import Path

import pytest
from wrong_inputs import FILES, OVERRIDES, PLANAR

from finger_pin.description.loading import load_finger, load_scenario, to_toml
from finger_pin.exceptions import InputError


def load_overridden(text):
    key, _, value = text.partition("=")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value
    return load_scenario("reversals", {key: parsed})


@pytest.mark.slow
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
        ("../reversals", "no such file"),
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
    finger = tomllib.loads(to_toml(load_finger("ub_stand_in")))
    finger["joints"]["medial"]["link"]["lenght"] = finger["joints"]["medial"]["link"].pop("length")
    with pytest.raises(InputError, match=r"did you mean finger\.joints\.medial\.link\.length"):
        load_scenario("reversals", {"finger": finger})


def test_an_input_error_carries_entry_value_and_what_is_allowed():
    with pytest.raises(InputError) as caught:
        load_scenario("reversals", {"controller.gain": -2.0})
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
            load_scenario("reversals", {"finger.gravity": value})
        assert str(caught.value).startswith(f"finger.gravity = {text}: ")
