"""A joint on one tendon that a motor pulls, free of all friction and weight that is not asked for; and its motors."""

import numpy as np

import finger_pin as fp

#: Without gravity, and what cannot be zero so small that it does not count.
NOTHING = {"coulomb": 0.0, "viscous": 0.0}
RADIUS, SPOOL, INERTIA = 0.008, 0.005, 1.9e-3
LIMITS = {"voltage": 5.0, "maximum_current": 1.5, "encoder": {"range": [-100.0, 100.0]}}
#: Without any friction.
SMOOTH = {"torque_constant": 0.4, "resistance": 3.0, "inertia": INERTIA, "friction": {"coulomb": 0.0}, **LIMITS}
LINK = {"length": 0.05, "width": 0.01, "mass": 0.02, "centre_of_mass": 0.03, "transverse_inertia": 1e-5}
#: About the joint, kg m2.
LINK_INERTIA = 1e-5 + 0.02 * 0.03**2


def finger(motor, *, link=LINK, opposed=False, gravity=0.0, canal=0.0, **actuator):
    """A finger with one joint; ``opposed`` adds a second tendon, on the same spool, that turns the joint back."""
    radii = {"flexor": RADIUS, "extensor": -RADIUS} if opposed else {"flexor": RADIUS}
    tendons = {name: {"curvature_offset": 1.0, "crossings": {"knuckle": {"radius": r}}} for name, r in radii.items()}
    if isinstance(motor, str):
        motor = motor_of(motor)
    return fp.Finger(
        fp.FingerDescription.model_validate(
            {
                "name": "one",
                "gravity": [0.0, -gravity, 0.0],
                "joints": {"knuckle": {"range": [-6.0, 6.0], "link": link}},
                "tendons": tendons,
                "tendon_friction": {**NOTHING, "coulomb": canal, "floor": 1e-9},
                "joint_friction": {**NOTHING, "stiction": 0.0, "floor": 1e-12},
                "actuators": {"servo": {"motor": motor, "tendons": list(radii), "spool_radius": SPOOL, **actuator}},
            }
        )
    )


def motor_of(name):
    """A motor that ships."""
    overrides = {"finger.actuators": {"M": {"motor": name, "tendons": ["T1"], "spool_radius": SPOOL}}}
    return fp.load_finger("ub_stand_in", overrides).actuators["M"].motor


def stepped(finger, command, times, *, angle=0.0, spool=None, stiction=0.0, rtol=1e-9):
    """Position and velocity of joint and spool, shape (times, 4), under a command that is held, from rest."""
    sim = fp.Simulator(finger, [angle], rtol=rtol, atol_scale=rtol)
    x = sim.x
    start = finger.layout.unpack(x)
    start.gearbox_stiction[:] = stiction
    if spool is not None:
        start.motor_position[:] = start.spool_position[:] = spool
    sim.x = x
    found, reached = [], 0.0
    for time in times:
        if time > reached:
            sim.step(command, time - reached)
        reached, state = time, sim.state
        found.append([state.position[0], state.velocity[0], state.motor_position[0], state.motor_velocity[0]])
    return np.array(found)


def together(motor, radii, **actuator):
    """A chain of joints under springs, a cord each with a pulley of its radius, all on the spool of one motor."""
    names = ["abcdefgh"[index] for index in range(len(radii))]
    spring = {"stiffness": 0.2, "damping": 0.02}
    return fp.Finger(
        fp.FingerDescription.model_validate(
            {
                "name": "together",
                "gravity": [0.0, 0.0, 0.0],
                "joints": {name: {"range": [-6.0, 6.0], "spring": spring, "link": LINK} for name in names},
                "tendons": {
                    f"cord_{name}": {"crossings": {name: {"radius": radius}}}
                    for name, radius in zip(names, radii, strict=True)
                },
                "tendon_friction": {**NOTHING, "floor": 1e-9},
                "joint_friction": {**NOTHING, "stiction": 0.0, "floor": 1e-12},
                "actuators": {"servo": {"motor": motor, "tendons": [f"cord_{name}" for name in names], **actuator}},
            }
        )
    )


def scenario(made, duration, **sections):
    """A scenario of a finger with one joint, in open loop, at a tight tolerance."""
    table = {
        "name": "one",
        "finger": made.description.model_dump(exclude_none=True),
        "controller": {"kind": "tensions", "minimum_tension": 0.7},
        "simulation": {"duration": duration, "rtol": 1e-9, "atol_scale": 1e-9},
    }
    return fp.Scenario.model_validate(table | sections)
