"""Hands whose meshes collide, closing on a fixed ball here and in MuJoCo, to which a mesh is its hull.

Every joint that the model drives, of a model that drives none every joint that no equality leads, gets a servo in the
place of the model's own actuators, and the hand closes without gravity and friction until its links are some way in a
ball between its fingertips.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.exchange.mujoco_names import entry_name
from finger_pin.mechanism.contact_rows import DEEPEST_START
from finger_pin.typing import Array

# Servos of hinges, N m/rad, and of slides, N/m, and how long they take, s.
_HINGE, _SLIDE, _LAG = 1.0, 1000.0, 0.1
# Least armature of joints, kg m2 and kg: links of some models have hardly any.
_ARMATURE = (1e-5, 1e-2)
# Largest and least radius of the ball, m, its part of the room that the open hand leaves, and postures on the way.
_RADIUS, _LEAST, _ROOM, _PLACES = 0.03, 2e-3, 0.7, 64
#: How long the hand closes, and the time step of MuJoCo, s.
DURATION, TIME_STEP = 1.0, 5e-4
# How far links are in the ball at the goals of servos, m.
_DEPTH = 5e-3
BALL = "ball_in_the_hand"
# Contacts: nearly rigid, as a law of both; what they give way is not the primitives' fault.
_SOLREF, _SOLIMP = [0.002, 1.0], [0.98, 0.99, 0.001, 0.5, 2.0]


def load(path: Path) -> Any:
    """Return a specification whose joints are driven by servos alone, frictionless, with nearly rigid contacts.

    Raises:
        ValueError: If MuJoCo refuses the file, or it has other joints than hinges and slides.
    """
    import mujoco

    # Files that a model names stand beside it, not beside a link to it.
    spec = mujoco.MjSpec.from_file(str(path.resolve()))
    spec.compiler.balanceinertia = True
    kinds = {mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE}
    if others := [joint.name for joint in spec.joints if joint.type not in kinds]:
        raise ValueError(f"joints {', '.join(others)} neither turn nor slide about one axis")
    driven = {each.target for each in spec.actuators if each.trntype == mujoco.mjtTrn.mjTRN_JOINT}
    led = {each.name1 for each in spec.equalities if each.type == mujoco.mjtEq.mjEQ_JOINT}
    for each in [*spec.actuators, *spec.keys, *spec.sensors]:
        spec.delete(each)
    for tendon in spec.tendons:
        tendon.frictionloss, tendon.stiffness = 0.0, 0.0 * tendon.stiffness
    # Parts of robots leave it to the whole that their angles are in radians: no hand closes by 7 degrees.
    hinges = [joint.range for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE]
    if spec.compiler.degree and np.max(np.abs(hinges), initial=0.0) < 7.0:
        spec.compiler.degree = False
    for k, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint_{k}"
        slides = joint.type == mujoco.mjtJoint.mjJNT_SLIDE
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.frictionloss, joint.damping = 0.0, 0.0 * joint.damping
        joint.armature = max(joint.armature, _ARMATURE[slides])
        if joint.name in driven or not (driven or joint.name in led):
            servo = spec.add_actuator(name=f"{joint.name}_servo", target=joint.name)
            servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
            servo.ctrllimited = servo.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
            servo.set_to_position(kp=(_HINGE, _SLIDE)[slides], kv=_LAG * (_HINGE, _SLIDE)[slides])
    for k, geom in enumerate(spec.geoms):
        geom.condim, geom.solref, geom.solimp, geom.margin, geom.gap = 1, _SOLREF, _SOLIMP, 0.0, 0.0
        geom.name = geom.name or f"geom_{k}"
    spec.option.gravity, spec.option.timestep = [0.0, 0.0, 0.0], TIME_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


class Hand:
    """A hand with a ball in the world, which fits where the hand closes.

    Attributes:
        spec: With the ball and a keyframe, the open hand.
        model: Compiled from it; its links touch each other.
        path: Postures on the way from the open hand, which the keyframe has, to the closed one.
        goals: Of the servos, by joint.
        hinges: Names of the joints that turn.
    """

    def __init__(self, path: Path) -> None:
        """Read a model.

        Raises:
            ValueError: If MuJoCo refuses the file, or there is no place for a ball.
        """
        import mujoco

        self.mujoco, self.spec = mujoco, load(path)
        sphere, surface = mujoco.mjtGeom.mjGEOM_SPHERE, {"condim": 1, "solref": _SOLREF, "solimp": _SOLIMP}
        self.spec.worldbody.add_geom(name=BALL, type=sphere, size=[_RADIUS, 0.0, 0.0], **surface)
        self.model = model = self.spec.compile()
        self.data = mujoco.MjData(model)
        bits = model.geom_contype | model.geom_conaffinity
        self.geoms = [i for i in np.flatnonzero(bits).tolist() if model.body_weldid[model.geom_bodyid[i]]]
        self.meshes = [i for i in self.geoms if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH]
        self.ball = model.geom(BALL).id
        if not self.meshes:
            raise ValueError("no mesh that moves collides")
        self.path = self._closing()
        centre, radius = self._place_for_ball()
        ball = self.spec.geom(BALL)
        ball.pos, ball.size = centre, [radius, 0.0, 0.0]
        self.goals = self._goals(centre, radius)
        self.spec.add_key(name="open", qpos=self.path[0])
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        hinges = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).tolist()
        self.hinges = {entry_name(self.model.joint(i).name) for i in hinges}

    def pose(self, position: Array) -> None:
        """Move the hand to a posture."""
        self.data.qpos[:] = position
        self.mujoco.mj_kinematics(self.model, self.data)

    def _tips(self) -> Array:
        """Return the middles of the last links with geoms, shape (n, 3), m."""
        model, links = self.model, dict[int, list[int]]()
        for i in self.geoms:
            links.setdefault(int(model.body_weldid[model.geom_bodyid[i]]), []).append(i)
        carriers = set[int]()
        for body in links:
            while body := int(model.body_weldid[model.body_parentid[body]]):
                carriers.add(body)
        ends = [geoms for body, geoms in links.items() if body not in carriers]
        return np.array([self.data.geom_xpos[geoms].mean(axis=0) for geoms in ends])

    def _closing(self) -> list[Array]:
        """Return postures on the way from the open hand to the closed one.

        Goals are the farther ends of ranges that lie to one side, and the hand closes where its tips come together.
        """
        model, rest, far = self.model, dict[str, float](), dict[str, float]()
        for i in range(model.nu):
            joint = model.joint(int(model.actuator_trnid[i, 0]))
            start, limited = float(model.qpos0[joint.qposadr[0]]), bool(model.jnt_limited[joint.id])
            ends = sorted(joint.range if limited else (start, start), key=lambda end: abs(end - start))
            rest[joint.name] = float(np.clip(start, min(ends), max(ends)))
            far[joint.name] = float(ends[1]) if abs(ends[1] - start) > 1.7 * abs(ends[0] - start) else start
        path = self._path(rest, self._path(rest, model.qpos0)[-1])
        path = self._path(far, path[-1])
        widths = []
        for position in (path[0], path[-1]):
            self.pose(position)
            tips = self._tips()
            widths.append(np.linalg.norm(tips - tips.mean(axis=0), axis=1).sum())
        return path if widths[1] < widths[0] else self._path(rest, path[-1])

    def _path(self, goals: dict[str, float], position: Array) -> list[Array]:
        """Return postures on the way to goals, from rest, with nothing to touch."""
        mujoco, model, data = self.mujoco, self.model, self.mujoco.MjData(self.model)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        data.qpos[:] = position
        found = [data.qpos.copy()]
        for name, goal in goals.items():
            data.actuator(f"{name}_servo").ctrl = goal
        for _ in range(_PLACES):
            mujoco.mj_step(model, data, round(DURATION / TIME_STEP / _PLACES))
            found.append(data.qpos.copy())
        return found

    def _place_for_ball(self) -> tuple[Array, float]:
        """Return centre and radius of the ball that most links reach: amid the tips, or between one and the others."""
        places = []
        for position in self.path[8::8]:
            self.pose(position)
            tips = self._tips()
            apart = np.linalg.norm(tips[:, None] - tips, axis=-1).sum(axis=1)
            others = np.delete(tips, apart.argmax(), axis=0)
            places += [tips.mean(axis=0), 0.5 * (tips[apart.argmax()] + others.mean(axis=0))]
        self.pose(self.path[0])
        rooms = [min(_RADIUS, _ROOM * min(self.gaps(place, 0.0).values())) for place in places]
        tries = [(place, room) for place, room in zip(places, rooms, strict=True) if room > _LEAST]
        if not tries:
            raise ValueError("no room for a ball")
        reached = [set[int]() for _ in tries]
        for position in self.path:
            self.pose(position)
            for links, (place, room) in zip(reached, tries, strict=True):
                links |= {int(self.model.geom_bodyid[i]) for i, gap in self.gaps(place, room).items() if gap < 0.0}
        if not any(reached):
            raise ValueError("no link reaches a ball")
        return max(zip(map(len, reached), [each[1] for each in tries], tries, strict=True), key=lambda e: e[:2])[2]

    def _goals(self, centre: Array, radius: float) -> dict[str, float]:
        """Return goals of the servos, by joint: where the first link that a joint moves is some way in the ball.

        Farther ones would let a finger slip off a ball that does not rub.
        """
        model, reached = self.model, dict[int, Array]()
        for position in self.path:
            self.pose(position)
            deep = [int(model.geom_bodyid[i]) for i, gap in self.gaps(centre, radius).items() if gap < -_DEPTH]
            for body in deep:
                while body:
                    reached.setdefault(body, position)
                    body = int(model.body_parentid[body])
        joints = [model.joint(int(model.actuator_trnid[i, 0])) for i in range(model.nu)]
        return {each.name: float(reached.get(each.bodyid[0], self.path[-1])[each.qposadr[0]]) for each in joints}

    def gaps(self, place: Array, radius: float) -> dict[int, float]:
        """Return the distances of geoms, of meshes by their hulls, from a ball in the posture at hand, m."""
        model, data = self.model, self.data
        model.geom_size[self.ball, 0], data.geom_xpos[self.ball] = max(radius, _LEAST), place
        room, line = 0.3, np.zeros(6)
        found = {i: self.mujoco.mj_geomDistance(model, data, self.ball, i, room, line) for i in self.geoms}
        return {i: gap + max(radius, _LEAST) - radius for i, gap in found.items()}

    def overlaps(self) -> int:
        """Return how many pairs of links overlap in the open hand, by their hulls."""
        self.mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        self.mujoco.mj_forward(self.model, self.data)
        deep = self.data.contact.geom[self.data.contact.dist < -DEEPEST_START]
        return len({(int(a), int(b)) for a, b in deep})

    def alone(self) -> Any:
        """Return the specification of the hand whose links touch the ball alone."""
        spec, ids = self.spec.copy(), {self.model.geom(i).name for i in self.geoms}
        for geom in spec.geoms:
            geom.contype, geom.conaffinity = int(geom.name in ids), int(geom.name == BALL)
        return spec
