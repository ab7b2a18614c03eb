"""What presses on the pins of a finger's joints: the tendons as in (17), or along their paths and with the weight."""

from __future__ import annotations

import numpy as np

from finger_pin.blocks.joint_friction import PinLoads
from finger_pin.blocks.rigid_body import RigidBody
from finger_pin.exceptions import InputError
from finger_pin.geometry import TendonGeometry
from finger_pin.parameters import FingerDescription
from finger_pin.routing import Array, Routing


def pin_loads(description: FingerDescription, routing: Routing, body: RigidBody, *, foreign: bool) -> PinLoads:
    """Return what the description asks for.

    Args:
        description: The finger.
        routing: Of its tendons.
        body: Its rigid body.
        foreign: Whether that is not the one that the description's links make.

    Raises:
        InputError: If the full reaction is asked for on a foreign body, where nobody knows the tendons' paths.
    """
    if description.joint_friction.reaction == "paper":
        return PinLoads.of_paper(routing.loads, np.array(body.proximal_axes[1:]))
    if foreign:
        allowed = "must be paper on a model of one's own: the full reaction needs the tendons' paths along the links"
        raise InputError("finger.joint_friction.reaction", allowed, description.joint_friction.reaction)
    return PinLoads(strand_pulls(TendonGeometry(description), routing), body.distal_weights())


def strand_pulls(geometry: TendonGeometry, routing: Routing) -> Array:
    """Return P of `PinLoads`, shape (n, 3, s): sums of the directions in which each strand meets each joint.

    With the grooves on the distal link these are at rest in the proximal one, which makes P a constant.
    """
    pulls = np.zeros((len(routing.joints), 3, len(routing.strand_coupling)))
    for cut in geometry.cuts():
        pulls[cut.joint - 1, :, routing.strand(cut.tendon, distal=cut.distal)] += cut.direction
    return pulls
