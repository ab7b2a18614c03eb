"""Fingers whose URDF is looked at, and how it is read."""

import pinocchio as pin

OTHER_LENGTHS = {
    f"finger.joints.{name}.link.{key}": value
    for name, length in {"abduction": 0.013, "proximal": 0.071, "medial": 0.0417, "distal": 0.0093}.items()
    for key, value in {"length": length, "centre_of_mass": 0.4 * length}.items()
}
JOINTS = ("abduction", "proximal", "medial", "distal")
SQUARE = {f"finger.joints.{name}.link.section": "square" for name in JOINTS}

FINGERS = {
    "ub_stand_in": ("ub_stand_in", {}),
    "dexmart_index": ("dexmart_index", {}),
    "planar": ("planar", {}),
    "other lengths": ("ub_stand_in", OTHER_LENGTHS),
    "square": ("ub_stand_in", SQUARE),
}


def read_by_pinocchio(urdf, kind):
    """Read the shapes of a URDF from memory."""
    return pin.buildGeomFromUrdfString(pin.buildModelFromXML(urdf), urdf, kind)


def links_of(finger):
    return [joint.link for joint in finger.joints.values()]
