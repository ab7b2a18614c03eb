"""Full force and moment on the pin of every joint, approximated by (17).

Cut a joint open and free everything that it carries. On it act its weight, the fingertip force F, the tendons that
cross the cut, each with its tension along its path, and the pin. Newton and Euler give what the pin must exert:

    P_j = sum m (a - g) + sum f t - F,      moments likewise, about the joint's origin,

with t the direction of a tendon from its actuator on. The first sum is that of recursive Newton-Euler (Pinocchio's).
(17) keeps e_j S_j - F: no weight, no inertia, and all tendons along the proximal link.

Assumptions:

- A tendon has the tension f of (12) wherever it crosses a joint, since (12) puts its friction before the joints. What a
  canal does to the link that it is in happens within what is cut free, and so does the friction of a passive tendon,
  which acts on the link of its lumped mass. Tendons have no mass here, lumped masses included.
- Grooves are part of the distal or of the proximal link (`tendon_cuts.Groove`). A pulley that turns on the pin counts
  with the link that holds the pin: friction is then that of the pin in the other link.
- Joint friction and stroke limiters are couples about the axis, as in (18). So the moment of the pin about its axis is
  -(tau^f + tau^r), which checks directions and points of attack of all forces at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.analysis.printing import BriefRepr
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.typing import Array
from paper.tendon_cuts import Groove, tendon_cuts


@dataclass(frozen=True, eq=False, repr=False)
class PinWrench(BriefRepr):
    """Wrenches of the pins on the links that they carry, base frame, about the joints' origins; shapes (m, n, 3).

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
    finger: FingerLike,
    position: Array,
    velocity: Array,
    acceleration: Array,
    strands: Array,
    fingertip_force: Array,
    groove: Groove = Groove.DISTAL,
) -> PinWrench:
    """Return the forces and moments of the pins at m states.

    Args:
        finger: A finger whose joints all carry links.
        position: theta, shape (m, n), rad.
        velocity: theta', shape (m, n), rad/s.
        acceleration: theta'', shape (m, n), rad/s2.
        strands: f, shape (m, s), N.
        fingertip_force: F, shape (3,) or (m, 3), N, base frame.
        groove: Link that the grooves are part of.

    Raises:
        InputError: If a joint carries no link.
    """
    finger = as_finger(finger)
    geometry, body, routing = TendonGeometry(finger.description), finger.rigid_body, finger.routing
    carried = -body.distal_weights()
    links = _links(finger, position, velocity, acceleration)
    origin, force = links.translation[:, 1:], fingertip_force[..., None, :]
    moment = links.moment - np.cross(links.tip[:, None] - origin, force)
    tendons = np.zeros_like(moment)
    for cut in tendon_cuts(geometry, groove):
        j, turn = cut.joint - 1, links.rotation[:, cut.link]
        pull = strands[:, routing.strand(cut.tendon, distal=cut.distal), None] * (turn @ cut.direction)
        tendons[:, j] += pull
        moment[:, j] += np.cross(turn @ cut.point + links.translation[:, cut.link] - origin[:, j], pull)
    directions = np.einsum("mjrc,jc->mjr", links.rotation[:, body.parent_links[1:]], body.proximal_axes[1:])
    return PinWrench(
        axis=links.rotation[:, 1:, :, 2],
        paper=directions * (strands @ routing.loads.T)[..., None],
        tendons=tendons,
        carried=np.broadcast_to(carried, tendons.shape),
        inertia=links.force - carried,
        external=np.broadcast_to(-force, tendons.shape),
        moment=moment,
    )


@dataclass(frozen=True, eq=False)
class _Links:
    """Places of the base (entry 0) and the links, and the wrenches that their motion needs, base frame.

    Attributes:
        rotation: Shape (m, n + 1, 3, 3).
        translation: Shape (m, n + 1, 3), m.
        tip: Shape (m, 3), m.
        force: sum m (a - g), shape (m, n, 3), N.
        moment: The same for moments about the joints' origins, shape (m, n, 3), N m.
    """

    rotation: Array
    translation: Array
    tip: Array
    force: Array
    moment: Array


def _links(finger: Finger, position: Array, velocity: Array, acceleration: Array) -> _Links:
    model, frame = finger.rigid_body.model, finger.rigid_body.tip_frame
    data, count, links = model.createData(), len(position), model.njoints
    rotation, translation, tip = np.zeros((count, links, 3, 3)), np.zeros((count, links, 3)), np.zeros((count, 3))
    wrench = np.zeros((count, links, 2, 3))
    for k, state in enumerate(zip(position, velocity, acceleration, strict=True)):
        # Newton-Euler alone leaves the links unplaced.
        pin.framesForwardKinematics(model, data, state[0])
        pin.rnea(model, data, *state)
        tip[k] = data.oMf[frame].translation
        for j, (place, needed) in enumerate(zip(data.oMi, data.f, strict=True)):
            rotation[k, j], translation[k, j] = place.rotation, place.translation
            wrench[k, j] = needed.linear, needed.angular
    turned = np.einsum("mjrc,mjkc->mjkr", rotation, wrench)[:, 1:]
    return _Links(rotation, translation, tip, turned[:, :, 0], turned[:, :, 1])
