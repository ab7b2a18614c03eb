"""Laws side by side: those of a tendon that is drawn through a canal are regressions, in closed form."""

from importlib.resources import files

import compare_laws
import numpy as np
import pytest
import xarray as xr
from compare_laws import LAWS, SCENARIO_LAW, Law, Row

from finger_pin.description.loading import ParametrisedScenario, load_bench
from finger_pin.exceptions import InputError

TENDON = "tendon_tension.T1"
DRAG = "finger.tendon_friction.drag"


@pytest.fixture(scope="module")
def rows():
    return dict(compare_laws.compare("transmission", 1))


@pytest.fixture(scope="module")
def readings():
    """Force in and force out, N, that are fitted, and those that are held out."""
    with (files("finger_pin.description") / "benches" / "transmission.csv").open(encoding="utf-8") as file:
        table = np.loadtxt([line for line in file if line[0].isdigit()], delimiter=",")
    return table[table[:, 0] < 13.0].T, table[table[:, 0] > 13.0].T


def regressions(pull, out):
    """Return slope and intercept of force out over force in, and the number of parameters, by law."""
    slope, intercept = np.polyfit(pull, out, 1)
    return {
        # The most drag that it may have, 1 mN, as every loss is welcome.
        "none": (1.0, -1e-3, 1),
        "constant": (1.0, np.mean(out - pull), 1),
        "capstan without bristle": (pull @ out / (pull @ pull), 0.0, 1),
        SCENARIO_LAW: (slope, intercept, 2),
    }


@pytest.mark.slow
def test_laws_of_a_canal_are_regressions(rows, readings):
    (pull, out), (heavy, arrived) = readings
    laws = regressions(pull, out)
    squares = {name: np.sum((out - a * pull - b) ** 2) for name, (a, b, _) in laws.items()}
    for name, (a, b, count) in laws.items():
        row = rows[name]
        assert isinstance(row, Row) and row.parameters == count
        assert row.signals[TENDON].fitted == pytest.approx(np.sqrt(squares[name] / len(pull)), rel=1e-4)
        missed = np.sqrt(np.mean((arrived - a * heavy - b) ** 2))
        assert row.signals[TENDON].held_out == pytest.approx(missed, rel=1e-4)
        bic = len(pull) * np.log(squares[name] / squares[SCENARIO_LAW]) + (count - 2) * np.log(len(pull))
        described = rows[SCENARIO_LAW]
        # The least level of the law, 0.1 mN, is left where there is none.
        assert row.bic - described.bic == pytest.approx(bic, abs=0.01)


def test_bristles_and_viscous_friction_do_not_show_where_readings_have_settled():
    constant = LAWS["transmission"]["constant"]
    plain = compare_laws.fit_law("transmission", constant, 1)
    changed = {"finger.tendon_friction.stiffness": 1e3, "finger.tendon_friction.viscous": 4.0}
    other = compare_laws.fit_law("transmission", Law({**constant.values, **changed}, constant.searched), 1)
    # At 0.05 m/s a viscous part is so much less of a constant one.
    assert other.estimate.values == pytest.approx(plain.estimate.values - 4.0 * 0.05, abs=1e-6)
    assert other.residual.values == pytest.approx(plain.residual.values, abs=1e-6)


def test_samples_count_under_all_laws_as_under_the_reference(readings):
    (pull, out), _ = readings
    law = LAWS["transmission"]["constant"]
    result = compare_laws.fit_law("transmission", law, 1)
    # As if of every four readings one was independent; the search for its BIC does not begin at the best place.
    reference = result.assign(independent_share=("signal", [0.25]))
    moved = result.assign(estimate=result.estimate - 0.4)
    count, misfit = 0.25 * len(pull), np.mean((out - pull - np.mean(out - pull)) ** 2)
    expected = count * np.log(misfit) + np.log(count)
    assert compare_laws.comparable_bic("transmission", law, moved, reference) == pytest.approx(expected, abs=1e-3)


def test_all_samples_of_a_variable_count_alike():
    data = {"rms": ("signal", [3.0, 1.0, 7.0]), "size": ("signal", [10, 30, 5])}
    result = xr.Dataset(data, {"signal": ["a.angle", "b.angle", "a.force"]})
    rms = compare_laws.by_variable(result, "signal", "rms", "size", 2.0)
    assert rms == pytest.approx({"angle": np.sqrt((10 * 9.0 + 30 * 1.0) / 40), "force": 7.0})


@pytest.mark.slow
def test_every_bench_has_the_same_laws_whose_keys_it_knows():
    for bench, laws in LAWS.items():
        assert list(laws) == list(LAWS["transmission"])
        for law in laws.values():
            if isinstance(law, str):
                assert isinstance(laws[law], Law)
                continue
            scenario, parameters, recordings = compare_laws.law_problem(bench, law)
            assert recordings.keys() == load_bench(bench)[1].recordings.keys()
            # All are keys of the scenario, else this refuses them.
            ParametrisedScenario(scenario, tuple(parameters)).with_values([low for low, _ in parameters.values()])
    with pytest.raises(InputError, match="dragg"):
        compare_laws.law_problem("transmission", Law({DRAG + "g": 0.0}))


def test_the_figure_has_a_panel_for_each_bench_and_a_point_for_each_law(rows):
    figure = compare_laws.plot_laws({"transmission": rows})
    (axes,) = figure.axes
    names = [each.get_text() for each in axes.get_yticklabels()]
    assert names == [*LAWS["transmission"], SCENARIO_LAW]
    ratio, place = axes.lines[0].get_data()
    expected = {name: row.signals[TENDON].held_out for name, row in rows.items() if isinstance(row, Row)}
    drawn = {names[k]: value for k, value in zip(place, ratio, strict=True)}
    assert drawn == pytest.approx({name: value / expected[SCENARIO_LAW] for name, value in expected.items()})
    assert [each.get_text().strip() for each in axes.texts] == ["as constant"] * 2


def test_a_bench_that_has_no_laws_is_refused(capsys):
    with pytest.raises(SystemExit):
        compare_laws.main(["weights"])
    assert "no such bench: weights; there are instrument, servo_pendulum, transmission" in capsys.readouterr().err
