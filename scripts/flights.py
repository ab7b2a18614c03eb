"""Let bodies fly, spin and sweep at random towards each other, and count the touches that a simulation has missed.

Until bodies touch, their motion is known in closed form, and so is whether they touch. A touch counts as seen if a step
ends with bodies inside each other.

With ``--falls``, let every shape fall on every shape, and compare steps and their time with those of its fall on a
half-space.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time

import numpy as np
import pinocchio as pin
from validation.flight_scenarios import FALLEN_ON, FALLING, FAMILIES, Flight, falls

from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.core.tables.inputs import core_signal, held_control
from finger_pin.description.links import link_body, tree_of_links
from finger_pin.description.parameters import Joint, Link
from finger_pin.description.placement import PathSignal
from finger_pin.mechanism.body_places import Placed
from finger_pin.mechanism.contact_rows import contact_rows
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.solids import add_free_objects, body_solids, object_solids
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

#: No fall takes more than so many times the steps, or the time, of that on a half-space.
MOST_FALL = 10.0


def fly(flight: Flight, method: str, tolerance: float) -> tuple[Trajectory, Array]:
    """Return the trajectory, and the packed positions where steps end, shape (m, nq)."""
    model = pin.Model()
    model.gravity.linear[:] = [0.0, 0.0, -flight.gravity]
    links = []
    if flight.speed is not None:
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
        inertia = pin.Inertia(0.1, np.array([0.05, 0.0, 0.0]), 1e-5 * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        described = Joint(range=(-1.0, 1.0), link=Link(length=0.1, width=0.01, mass=0.1))
        tree, placed = tree_of_links({"joint": described}, {}), {link_body("joint"): Placed(joint, pin.SE3.Identity())}
        links = body_solids(tree, placed, RigidBody(model, []))
    body = add_free_objects(RigidBody(model, []), flight.objects)
    width = body.model.nv
    prescribed = np.full(width, -1)
    if flight.path is not None:
        prescribed[:6] = np.arange(6)
    rows = contact_rows([*links, *object_solids(flight.objects, body)], width)
    mechanism = Mechanism(body, [rows], prescribed=prescribed)
    start, moving = np.zeros(mechanism.size), len(links)
    start[: body.model.nq] = flight.exact(np.zeros(1))[0]
    velocity = start[body.model.nq :]
    velocity[:moving] = flight.speed
    for each in flight.objects.values():
        if each.moves:
            velocity[moving : moving + 6] = [*each.velocity, *each.angular_velocity]
            moving += 6
    control = held_control(mechanism.channels, mechanism.coordinates)
    if flight.path is not None:
        signal = Signal.from_settings([flight.path, *[PathSignal()] * 5])
        control, velocity[:6] = control._replace(guide=core_signal(signal)), signal.at(0.0)[1]
    scales = np.concatenate([np.full(body.model.nq, 1e-2), np.full(width, 1.0), np.full(mechanism.state_count, 1e-5)])
    stepper = Stepper(mechanism, control, start, TABLEAUS[method](), tolerance, tolerance * scales)
    found = integrate_compiled(stepper, flight.duration, tuple(map(str, range(mechanism.size))))
    return found, found.interpolate(found.breakpoints)[:, : body.model.nq]


def deepest(flight: Flight) -> float:
    """Return the least gap of bodies that nothing stops, m."""
    times = np.linspace(0.0, flight.duration, 20_001)
    gaps = flight.gap(flight.exact(times))
    near = np.unique(np.clip(np.argsort(gaps)[:20, None] + np.arange(-1, 2), 0, len(times) - 2))
    fine = (times[near][:, None] + times[1] * np.linspace(0.0, 1.0, 201)).ravel()
    return float(min(gaps.min(), flight.gap(flight.exact(fine)).min()))


def compare_falls(count: int, seed: int) -> int:
    """Let every shape fall on every shape, and print a table; return 1 if one took too many steps or too long."""
    bad, ratios = 0, f"{'steps, times':>14} {'most':>6}{'time, times':>14} {'most':>6}"
    print(f"{'falls':22} {ratios} {'most steps':>11} {'given up':>9}")
    for shape, onto in itertools.product(FALLING, FALLEN_ON):
        rng = np.random.default_rng([FALLING.index(shape), FALLEN_ON.index(onto), seed])
        figures, failed = np.zeros((count, 2, 2)), 0
        for fall, side in itertools.product(range(count), range(2)):
            if side == 0:
                pair = falls(rng, shape, onto)
            # Of two times the shorter: other programs run too.
            runs = [fly(pair[side], "Rodas5P", 1e-6)[0] for _ in range(2)]
            figures[fall, side] = runs[0].statistics.steps, min(each.statistics.wall_time for each in runs)
            failed += bool(runs[0].failure)
        ratio = figures[:, 0] / figures[:, 1]
        middle, most = np.median(ratio, axis=0), ratio.max(axis=0)
        bad += failed + int(np.count_nonzero(most > MOST_FALL))
        told = "".join(f"{middle[i]:14.2f} {most[i]:6.2f}" for i in range(2))
        told += f" {int(figures[:, 0, 0].max()):11} {failed:9}"
        print(f"{shape + ' on ' + onto:22} {told}", flush=True)
    return 1 if bad else 0


def main(given: list[str] | None = None) -> int:
    """Count, and print a table; return 1 if a touch was missed, or one seen that is none."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="flights of each family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--falls", type=int, metavar="N", help="instead, let every shape fall N times on every shape")
    chosen = parser.parse_args(given)
    if chosen.falls:
        return compare_falls(chosen.falls, chosen.seed)
    rng, bad = np.random.default_rng(chosen.seed), 0
    print(f"{'family':18} {'flights':>8} {'touch':>7} {'missed':>7} {'false':>7} {'given up':>9} {'seconds':>8}")
    for family in FAMILIES:
        began, flights, touches, missed, false, failed = time.process_time(), 0, 0, 0, 0, 0
        while flights < chosen.count:
            flight = family(rng)
            method, tolerance = str(rng.choice(["Rodas5P", "Rodas4"])), 10.0 ** -rng.integers(3, 11)
            depth = deepest(flight)
            if flight.gap(flight.exact(np.zeros(1)))[0] <= 0.0 or abs(depth) < flight.margin:
                continue
            flights += 1
            found, places = fly(flight, method, tolerance)
            touched = bool(flight.gap(places).min() < 0.0)
            failed += bool(found.failure)
            touches += depth < 0.0
            missed += depth < 0.0 and not touched
            false += depth > 0.0 and touched
        bad += missed + false
        name = family.__name__.replace("_", " ")
        counts = f"{flights:8} {touches:7} {missed:7} {false:7} {failed:9}"
        print(f"{name:18} {counts} {time.process_time() - began:8.1f}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
