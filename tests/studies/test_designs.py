"""Designs, and how their values are spelt."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.studies.designs import parse_range, parse_values


def test_a_grid_is_every_combination_with_the_last_key_fastest():
    grid = fp.studies.Grid({"a": [1.0, 2.0], "b": [5.0, 6.0, 7.0]})
    assert grid.dims == ("a", "b")
    assert grid.points() == [{"a": a, "b": b} for a in (1.0, 2.0) for b in (5.0, 6.0, 7.0)]


def test_a_list_takes_the_values_of_all_keys_together():
    listing = fp.studies.PointList({"a": [1.0, 2.0], "b": [5.0, 6.0]})
    assert listing.dims == ("sample",)
    assert listing.points() == [{"a": 1.0, "b": 5.0}, {"a": 2.0, "b": 6.0}]


def test_a_latin_hypercube_has_one_point_in_every_slice_of_every_range():
    size = 23
    cube = fp.studies.LatinHypercube(
        {"a": fp.studies.Range(-2.0, 3.0), "b": fp.studies.Range(1e-3, 10.0, logarithmic=True)}, size, seed=4
    )
    values = cube.values
    linear = np.floor((np.array(values["a"]) + 2.0) / 5.0 * size)
    decades = np.floor((np.log10(values["b"]) + 3.0) / 4.0 * size)
    assert sorted(linear) == sorted(decades) == list(range(size))


def test_a_seed_gives_the_same_points_again_and_another_one_others():
    ranges = {"a": fp.studies.Range(0.0, 1.0)}
    assert fp.studies.LatinHypercube(ranges, 5, 1).points() == fp.studies.LatinHypercube(ranges, 5, 1).points()
    assert fp.studies.LatinHypercube(ranges, 5, 1).points() != fp.studies.LatinHypercube(ranges, 5, 2).points()


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=1:3:5", (1.0, 1.5, 2.0, 2.5, 3.0)),
        ("a.b= 3 : 1 : 3", (3.0, 2.0, 1.0)),
        ("a.b=1:100:3:log", (1.0, 10.0, 100.0)),
        ("a.b=1,-2.5,1e-3", (1.0, -2.5, 0.001)),
        ("a.b=7", (7.0,)),
        ("a.b=2:9:1", (2.0,)),
        ("a.b=Rodas4, Rodas5P", ("Rodas4", "Rodas5P")),
        ("a.b=true,false", (True, False)),
        ("a.b=mine.toml,ub", ("mine.toml", "ub")),
    ],
)
def test_values_are_spelt_as_steps_or_as_a_list(text, values):
    key, found = parse_values(text)
    assert key == "a.b"
    assert found == (values if isinstance(values[0], str) else pytest.approx(values))


def test_a_range_is_spelt_by_its_ends():
    assert parse_range("a[2]=-1:2") == ("a[2]", fp.studies.Range(-1.0, 2.0))
    assert parse_range("a=0.1:2:log") == ("a", fp.studies.Range(0.1, 2.0, logarithmic=True))


@pytest.mark.parametrize(
    "text",
    ["a", "a=", "=1,2", "a=1:2", "a=1:2:0", "a=1:2:x", "a=1:2:3:4", "a=1,,2", "a=nan", "a=1:inf:3", "a=1,y",
     "a=-1:2:3:log", "a=1:2:99999999999999999999", "a=1:2:2.5"],
)  # fmt: skip
def test_wrong_values_are_told_in_one_line(text):
    with pytest.raises(fp.InputError) as caught:
        parse_values(text)
    assert str(caught.value).isprintable()
    assert text in str(caught.value)


@pytest.mark.parametrize("text", ["a=1", "a=1:2:3", "a=2:1", "a=1:1", "a=-1:1:log", "a=x:2", "a=0:inf"])
def test_wrong_ranges_are_told_in_one_line(text):
    with pytest.raises(fp.InputError):
        parse_range(text)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fp.studies.Grid({}),
        lambda: fp.studies.Grid({"a": []}),
        lambda: fp.studies.Grid({"a": [1.0, 1.0]}),
        lambda: fp.studies.Grid({"a": [float("nan")]}),
        lambda: fp.studies.Grid({"a[x]": [1.0]}),
        lambda: fp.studies.Grid({"a": ["x", "x"]}),
        lambda: fp.studies.Grid({"a": ["x", 1.0]}),
        lambda: fp.studies.Grid({"a": [None, None]}),
        lambda: fp.studies.Grid({"a": [[1.0], [2.0]]}),
        lambda: fp.studies.Grid({"a": range(1001), "b": range(1001)}),
        lambda: fp.studies.PointList({"a": [1.0], "b": [1.0, 2.0]}),
        lambda: fp.studies.LatinHypercube({}, 3),
        lambda: fp.studies.LatinHypercube({"a": fp.studies.Range(0.0, 1.0)}, 0),
        lambda: fp.studies.LatinHypercube({"a": fp.studies.Range(0.0, 1.0)}, 3, -1),
        lambda: fp.studies.LatinHypercube({"a": fp.studies.Range(1.0, 0.0)}, 3),
    ],
)
def test_designs_that_are_none_are_refused(make):
    with pytest.raises(fp.InputError):
        make()


@pytest.mark.parametrize("given", [3.0, "abc", None])
def test_an_argument_that_is_no_list_of_values_is_refused(given):
    with pytest.raises(fp.InputError, match=r"controller\.gain.*: must be given a list of values"):
        fp.studies.Grid({"controller.gain": given})
