"""A link on a hinge, whose motions have closed forms."""

import finger_pin as fp
from finger_pin.description.validation import validate

#: Moment of inertia of that link about its hinge, kg m^2.
HINGED_INERTIA = 2e-6 + 0.02 * 0.03**2


def hinged_link(**entries):
    """Return a finger of one link on a hinge with an actuator, without gravity, with further entries of its table."""
    body = {"mass": 0.02, "centre": [0.03, 0.0, 0.0], "inertia": [1e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0]}
    joints, actuators = {"hinge": {"body": "link", "bearing": False}}, {"push": {"joint": "hinge"}}
    tree = {"bodies": {"link": body}, "joints": joints, "actuators": actuators}
    table = {"name": "hinged", "gravity": [0.0, 0.0, 0.0], "tendons": {}, "tree": tree}
    return fp.Finger(validate(fp.FingerDescription, table | entries, ()))
