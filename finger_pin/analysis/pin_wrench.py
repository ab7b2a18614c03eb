"""The whole force and moment on the pin of every joint: what (17) approximates.

Cut a joint open and free everything that it carries. On it act its weight, the fingertip force F, the tendons that
cross the cut, each with its tension along its path, and the pin. Newton and Euler give what the pin must exert:

    P_j = sum m (a - g) + sum f t - F,      moments likewise, about the joint's origin,

with t the direction of a tendon from its actuator on. The first sum is that of recursive Newton-Euler (Pinocchio's).
(17) keeps e_j S_j - F: no weight, no inertia, and all tendons along the proximal link.

Assumptions:

- A tendon has the tension f of (12) wherever it crosses a joint, since (12) puts its friction before the joints. What a
  canal does to the link that it is in happens within what is cut free, and so does the friction of a passive tendon,
  which acts on the link of its lumped mass. Tendons have no mass here, lumped masses included.
- Grooves are part of the distal or of the proximal link (`geometry.cuts.Groove`). A pulley that turns on the pin counts
  with the link that holds the pin: friction is then that of the pin in the other link.
- Joint friction and stroke limiters are couples about the axis, as in (18). So the moment of the pin about its axis is
  -(tau^f + tau^r), which checks directions and points of attack of all forces at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.finger import Finger
from finger_pin.geometry import Groove, TendonGeometry
from finger_pin.routing import Array


@dataclass(frozen=True, eq=False)
class PinWrench:
    """What the pins exert on what the joints carry, base frame, moments about the joints' origins; shapes (m, n, 3).

    Attributes:
        axis: Unit vectors of the joint axes.
        paper: e_j S_j, the tendons as in (17), N.
        tendons: The tendons along their paths, N.
        carried: Against the weight, N.
        inertia: sum m a, N.
        external: -F, N.
        moment: Of all of it but ``paper``, N m.
    """

    axis: Array
    paper: Array
    tendons: Array
    carried: Array
    inertia: Array
    external: Array
    moment: Array

    @property
    def force(self) -> Array:
        """P_j, N."""
        return self.tendons + self.carried + self.inertia + self.external


def pin_wrench(
    finger: Finger,
    position: Array,
    velocity: Array,
    acceleration: Array,
    strands: Array,
    fingertip_force: Array,
    groove: Groove = Groove.DISTAL,
) -> PinWrench:
    """Return what the pins exert at m states.

    Args:
        finger: A finger whose joints all carry links.
        position: theta, shape (m, n), rad.
        velocity: theta', shape (m, n), rad/s.
        acceleration: theta'', shape (m, n), rad/s2.
        strands: f, shape (m, s), N.
        fingertip_force: F, shape (3,), N, base frame.
        groove: What the grooves are part of.

    Raises:
        InputError: If a joint carries no link.
    """
    geometry, body, routing = TendonGeometry(finger.description), finger.rigid_body, finger.routing
    model, data = body.model, body.model.createData()
    count, size = position.shape
    axis, tendons, inertia, moment = (np.zeros((count, size, 3)) for _ in range(4))
    cuts = [(cut, routing.strand(cut.tendon, distal=cut.distal)) for cut in geometry.cuts(groove)]
    carried = -body.distal_weights()
    for k in range(count):
        # Newton-Euler alone leaves the links unplaced.
        pin.framesForwardKinematics(model, data, position[k])
        pin.rnea(model, data, position[k], velocity[k], acceleration[k])
        places, tip = data.oMi, data.oMf[body.tip_frame].translation
        for j in range(size):
            place, needed = places[j + 1], data.f[j + 1]
            axis[k, j] = place.rotation[:, 2]
            inertia[k, j] = place.rotation @ needed.linear - carried[j]
            moment[k, j] = place.rotation @ needed.angular - np.cross(tip - place.translation, fingertip_force)
        for cut, strand in cuts:
            j, place = cut.joint - 1, places[cut.link]
            pull = place.rotation @ cut.direction * strands[k, strand]
            tendons[k, j] += pull
            moment[k, j] += np.cross(place.act(cut.point) - places[cut.joint].translation, pull)
    directions = np.array([body.link_directions(theta) for theta in position])
    return PinWrench(
        axis=axis,
        paper=directions * (strands @ routing.loads.T)[..., None],
        tendons=tendons,
        carried=np.broadcast_to(carried, tendons.shape),
        inertia=inertia,
        external=np.broadcast_to(-fingertip_force, tendons.shape),
        moment=moment,
    )
