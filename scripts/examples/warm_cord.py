"""Does a cord pull better when its canal gets warm?

Friction heats a canal of polymer, which then rubs less: a law that reads a temperature, and rows whose state that is.
Run it: python scripts/examples/warm_cord.py [FOLDER FOR THE PICTURE]
"""

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp
from finger_pin.laws.capstan import DRIVEN_TENDON

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
COULOMB, FALL, CAPACITY = 0.3, 0.005, 2e-3  # 1, 1/K, J/K of what warms: about 1.5 mg of polymer
cold_value, cold_slopes, cold_account = DRIVEN_TENDON.value, DRIVEN_TENDON.slopes, DRIVEN_TENDON.account


def warm(row, p):
    """Return the numbers of a tendon with mu_e (1 - FALL T) in place of mu_e."""
    mu, ratio, soft, viscous, stribeck, floor, exponent, lag, hardening, drag, acting, least, fall = p
    softer = mu * (1 - fall * row.reading)
    return softer, ratio, soft, viscous, stribeck, floor, exponent, lag, hardening, drag, acting, least


def slopes(row, p, signals):
    """Return those at this temperature, and by it: only mu_e phi counts, so that d/dmu_e is (phi / mu_e) d/dphi."""
    force, rate = cold_slopes(row, warm(row, p), signals)
    return (*force, 0.0), (*rate, -rate[5] * row.curvature * p[12] / (1 - p[12] * row.reading))


def heat(row, p):
    """Return no force, and C T' = (f^a - f) l': what friction takes of the tension, times the speed."""
    return 0.0 * row.speed, row.command * row.speed / p[0]


def heat_slopes(row, p, signals):
    """Return the slopes of the force, none, and of C T' by l' and by f^a - f."""
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, row.command / p[0], 0.0, 0.0, row.speed / p[0], 0.0)


WARM = replace(DRIVEN_TENDON, parameters=(*DRIVEN_TENDON.parameters, "fall"), slopes=slopes, reads_states=True)
WARM = replace(WARM, value=lambda row, p: cold_value(row, warm(row, p)))
WARM = replace(WARM, account=lambda row, p, *results: cold_account(row, warm(row, p), *results))
HEAT = fp.Law("heat", ("capacity",), heat, heat_slopes, lambda row, p, force, *_: (0.0 * force,), scale=1.0)

scenario = fp.load_scenario("canal", {"finger.tendon_friction.coulomb": COULOMB})
one, radius, turn = np.ones((1, 1)), 0.02, np.pi / 2
canal = fp.Rows("canal", HEAT, ("T1",), CAPACITY * one, radius * one, channels=[0], inputs={"driven_tendons": -one})
warming = lambda own: replace(own, law=WARM, parameters=[*own.parameters, [FALL]], readings={"canal": one})  # noqa: E731
finger = fp.Finger(scenario.finger, rows=[canal], tables={"driven_tendons": warming})
warmed, cold = fp.simulate(scenario, finger=finger), fp.simulate(scenario)
temperature = warmed.canal_state.squeeze()
# C dT = (f^a - f) dx with f = K x and f^a = K x exp(mu_e phi (1 - FALL T)) has this integral.
drawn, turned = radius * warmed.joint_position.squeeze(), COULOMB * turn
left = (1 - np.exp(-turned)) * np.exp(-FALL * turned * (0.2 / radius**2) * drawn**2 / (2 * CAPACITY))
expected = (1 + np.log1p(-left) / turned) / FALL
gain = float(warmed.tendon_tension[-1, 0] / cold.tendon_tension[-1, 0])
print(f"The canal warms by {float(temperature[-1]):.1f} K, and the cord delivers {100 * (gain - 1):.1f} % more.")

figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.0), layout="constrained")
left.plot(warmed.tendon_command, temperature, warmed.tendon_command, expected, "k:")
left.set(xlabel="tension at the motor (N)", ylabel="warmer by (K)")
for result, label in ((cold, "at one temperature"), (warmed, "warming")):
    right.plot(result.tendon_command, result.tendon_tension, label=label)
right.set(xlabel="tension at the motor (N)", ylabel="delivered (N)")
left.legend(["simulated", "closed form"])
right.legend()
fp.plots.save_figure(figure, FOLDER / "warm_cord.png")
