"""Field types: bounds, sizes, names, and that every physical number says its unit and where it comes from."""

import json
import math
from typing import Annotated

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import load_finger
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import (
    Description,
    Numbers,
    choice,
    choices,
    expand,
    nearest,
    real,
    reals,
    validate,
    vector,
)
from finger_pin.exceptions import InputError, toml_like


class Sample(Description):
    number: Annotated[float, real(0.0, 10.0)] = 1.0
    positive: Annotated[float, real(0.0, 10.0, above=True)] = 1.0
    many: Annotated[Numbers, reals(-1.0, 1.0)] = 0.0
    triple: Annotated[tuple[float, float, float], vector(3)] = (0.0, 0.0, 0.0)
    kind: Annotated[str, choice("left", "right")] = "left"


def complaint(**table):
    with pytest.raises(InputError) as caught:
        validate(Sample, table, ("sample",))
    return caught.value


def test_a_closed_bound_is_allowed_and_an_open_one_is_not():
    assert validate(Sample, {"number": 0.0, "positive": 10.0}, ()).number == 0.0
    assert complaint(positive=0.0).allowed == "must be above 0"
    assert complaint(number=-5e-324).allowed == "must be at least 0"
    assert complaint(number=math.nextafter(10.0, math.inf)).allowed == "must be at most 10"


def test_whole_numbers_and_numpy_scalars_are_numbers():
    sample = validate(Sample, {"number": 3, "positive": np.float64(2.5), "many": [np.int64(1), 0]}, ())
    assert (sample.number, sample.positive, sample.many) == (3.0, 2.5, (1.0, 0.0))
    assert type(sample.number) is float


@pytest.mark.parametrize("value", [True, "1", None, [1.0], {}, 1j, b"1", object()])
def test_anything_else_is_no_number(value):
    assert "number" in complaint(number=value).allowed


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2**1024, -(2**1024)])
def test_numbers_are_finite(value):
    for field in ("number", "positive", "many"):
        assert complaint(**{field: value}).allowed == "must be a finite number"


def test_an_error_in_a_list_names_the_place():
    assert complaint(many=[0.0, 0.5, 2.0]).entry == "sample.many[2]"
    assert complaint(triple=[0.0, "x", 0.0]).entry == "sample.triple[1]"


def test_a_vector_has_its_size():
    assert validate(Sample, {"triple": [1, 2, 3]}, ()).triple == (1.0, 2.0, 3.0)
    for wrong in ([1, 2], [1, 2, 3, 4], 1.0, "123", {}):
        assert complaint(triple=wrong).allowed == "must be a list of 3 numbers"


def test_a_choice_tells_the_names_and_the_nearest():
    assert complaint(kind="rihgt").allowed == "must be one of left, right; did you mean right?"
    assert complaint(kind="up").allowed == "must be one of left, right"
    assert complaint(kind=[]).allowed == "must be one of left, right"


def test_an_unknown_key_is_reported_before_any_other_error():
    error = complaint(number="x", nubmer=1.0)
    assert error.entry == "sample.nubmer"
    assert error.allowed.endswith("did you mean sample.number?")


@pytest.mark.parametrize(
    ("name", "found"), [("Gain", "gain"), ("gian", "gain"), ("gains", "gain"), ("xyzzy", None), ("", None), (7, None)]
)
def test_the_nearest_name_is_the_one_that_was_meant_or_none(name, found):
    assert nearest(name, ["gain", "minimum_tension", "kind"]) == found


def test_one_number_is_expanded_to_all_and_a_list_is_copied():
    np.testing.assert_array_equal(expand(2.0, 3), [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(expand((1.0, 2.0), 2), [1.0, 2.0])
    expanded = expand(2.0, 3)
    expanded[0] = 5.0
    np.testing.assert_array_equal(expanded, [5.0, 2.0, 2.0])


def test_numbers_of_a_finger_are_one_per_item_read_only_and_follow_an_unchecked_copy():
    finger = load_finger("ub_stand_in")
    changed = finger.updated(joint_friction={"viscous": (1.0, 2.0, 3.0, 4.0)})
    for description, expected in ((finger, [finger.joint_friction.viscous] * 4), (changed, [1.0, 2.0, 3.0, 4.0])):
        np.testing.assert_array_equal(description.numbers["joint_friction"]["viscous"], expected)
    np.testing.assert_array_equal(finger.numbers["tendon_friction"]["drag"], np.zeros(5))
    with pytest.raises(ValueError, match="read-only"):
        finger.numbers["joint_friction"]["viscous"][0] = 5.0


def test_descriptions_are_frozen():
    sample = Sample()
    with pytest.raises(ValidationError, match="frozen"):
        sample.number = 2.0


def models_of(model):
    yield model
    for field in model.model_fields.values():
        for part in (field.annotation, *getattr(field.annotation, "__args__", ())):
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from models_of(part)


@pytest.mark.parametrize("model", sorted(set(models_of(Scenario)), key=lambda each: each.__name__))
def test_every_physical_number_carries_its_unit_and_source(model):
    for name, field in model.model_fields.items():
        if "float" in str(field.annotation):
            extra = field.json_schema_extra
            assert extra is not None and extra["unit"] and extra["source"], f"{model.__name__}.{name}"
            assert field.description, f"{model.__name__}.{name}"


def test_the_schema_of_a_finger_shows_units():
    schema = json.dumps(FingerDescription.model_json_schema())
    for unit in ('"N/m"', '"kg"', '"m"', '"rad"'):
        assert f'"unit": {unit}' in schema


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        (1.5, "1.5"),
        (math.nan, "nan"),
        (-math.inf, "-inf"),
        ("a\nb", '"a\\nb"'),
        ('say "é"', '"say \\"é\\""'),
        ((1.0, (2, False)), "[1.0, [2, false]]"),
        ([], "[]"),
        ({}, "{}"),
        ({"a": 1}, "{ ... }"),
        (2**1000, "an integer of 302 digits"),
    ],
)
def test_values_are_shown_as_in_toml(value, text):
    assert toml_like(value) == text


def test_long_and_deep_values_are_cut():
    deep = []
    for _ in range(5000):
        deep = [deep]
    for value in ("x" * 10_000, list(range(10_000)), deep, ["x" * 1000] * 1000):
        assert len(toml_like(value)) <= 80


def test_few_names_are_all_listed():
    assert (
        choices("joint_positon", ["joint_position", "joint_velocity"])
        == "joint_position, joint_velocity; did you mean joint_position?"
    )


def test_of_many_names_those_are_listed_that_are_near():
    many = ["joint_position", "joint_velocity", *(f"power_of_{index}" for index in range(60))]
    said = choices("joint_positon", many)
    assert said.startswith("joint_position, joint_velocity, power_of_")
    assert said.endswith("and 57 more; did you mean joint_position?")


@pytest.mark.parametrize(
    ("entries", "named"), [({"gravty": 1.0}, "gravity"), ({"tendon_friction": {"drg": 1}}, "drag")]
)
def test_updates_of_entries_that_there_are_not_are_refused_with_the_nearest_name(entries, named):
    with pytest.raises(InputError, match=f"is no entry here; did you mean {named}"):
        load_finger("ub").updated(**entries)
