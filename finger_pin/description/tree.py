"""A hand as a tree of bodies, with tendons, couplings and actuators, such as a MuJoCo model.

It stands beside the joints and tendons of a `FingerDescription`, which keep the joints' ranges and springs. Units are
SI: of a joint that slides, angles are lengths in m and torques are forces in N. Frames and signs are MuJoCo's: a body's
frame is where its placement says while its joints are at their references, and the length of a tendon grows where its
joints' coefficients are positive. Quaternions are x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Self

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from finger_pin.description.caching import cached_property
from finger_pin.description.cords import Cord, CordElement
from finger_pin.description.meshes import Mesh
from finger_pin.description.objects import Object
from finger_pin.description.placement import PathSignal
from finger_pin.description.primitives import KINDS
from finger_pin.description.surface import BodyShape
from finger_pin.description.tree_actuators import TreeActuator, drivers
from finger_pin.description.tree_couplings import Coupling, coupled
from finger_pin.description.tree_parts import Body, Keyframe, Loop, Tip, TreeJoint, TreeSolid, TreeTendon
from finger_pin.description.validation import Description, Name, problem, suggestion
from finger_pin.description.waypoints import Waypoint
from finger_pin.typing import Array

#: What is more is no radius that a cord winds at, as `Crossing` has it, m.
LARGEST_RADIUS = 0.5


class Tree(Description):
    """Bodies with their joints, tendons and actuators. Parents precede children; joints are in the bodies' order."""

    bodies: dict[Name, Body] = Field(min_length=1, description="Bodies by name, parents first.")
    joints: dict[Name, TreeJoint] = Field(min_length=1, description="Joints by name, those of parents first.")
    tendons: dict[Name, TreeTendon] = Field({}, description="By name.")
    couplings: dict[Name, Coupling] = Field({}, description="By name.")
    loops: dict[Name, Loop] = Field({}, description="By name.")
    actuators: dict[Name, TreeActuator] = Field({}, description="By name.")
    keyframes: dict[Name, Keyframe] = Field({}, description="By name; runs start from the first, unless told else.")
    objects: dict[Name, Object] = Field({}, description="By name: what stands or lies around it in every run.")
    tip: Tip | None = Field(None, description="The only fingertip; in place of tips.")
    tips: dict[Name, Tip] = Field({}, description="Fingertips by name; without any, the ends of its chains are.")
    touching: tuple[tuple[Name, Name], ...] = Field((), description="Pairs of its own shapes that touch each other.")
    meshes: dict[Name, Mesh] = Field({}, description="Surfaces of solids, by name.")
    left_out: tuple[str, ...] = Field((), description="Elements of the model that were not carried over.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        earlier: list[str] = []
        for name, body in self.bodies.items():
            _check(f"bodies.{name}.parent", body.parent, earlier, "body before it")
            earlier.append(name)
            for key, solid in body.solids.items():
                _check(f"bodies.{name}.solids.{key}.mesh", solid.mesh, self.meshes, "mesh")
        for name, joint in self.joints.items():
            _check(f"joints.{name}.body", joint.body, self.bodies, "body")
        order = [earlier.index(joint.body) for joint in self.joints.values()]
        if order != sorted(order):
            raise problem("joints", "must follow the order of their bodies", list(self.joints))
        for name, tendon in self.tendons.items():
            for joint_name in tendon.joints or {}:
                _check(f"tendons.{name}.joints.{joint_name}", joint_name, self.joints, "joint")
            for point, place in (tendon.path or {}).items():
                _check(f"tendons.{name}.path.{point}.body", place.body, self.bodies, "body")
                side = place.side_point.body if place.side_point else None
                _check(f"tendons.{name}.path.{point}.side_point.body", side, self.bodies, "body")
        for name, coupling in self.couplings.items():
            kind, names = ("joint", [*self.joints]) if coupling.joint else ("tendon", [*self.tendons])
            _check(f"couplings.{name}.{kind}", coupling.follower, names, kind)
            _check(f"couplings.{name}.other", coupling.other, names, kind)
        for name, loop in self.loops.items():
            _check(f"loops.{name}.body", loop.body, self.bodies, "body")
            _check(f"loops.{name}.other", loop.other, self.bodies, "body")
        for name, keyframe in self.keyframes.items():
            for entry in ("position", "velocity"):
                for joint_name in getattr(keyframe, entry):
                    _check(f"keyframes.{name}.{entry}.{joint_name}", joint_name, self.joints, "joint")
            for key, state in keyframe.objects.items():
                _check(f"keyframes.{name}.objects.{key}", key, self.objects, "object")
                if self.objects[key].mass is None:
                    state.check_at_rest(f"keyframes.{name}.objects.{key}.")
        for name, actuator in self.actuators.items():
            _check(f"actuators.{name}.joint", actuator.joint, self.joints, "joint")
            _check(f"actuators.{name}.tendon", actuator.tendon, self.tendons, "tendon")
            for entry in ("body", "other"):
                _check(f"actuators.{name}.wrench.{entry}", getattr(actuator.wrench, entry, None), self.bodies, "body")
        self._check_shapes()
        self._check_paths()
        if self.tip is not None and self.tips:
            raise problem("tip", "is for a single fingertip; leave it out beside tips", list(self.tips))
        for entry, tip in (("tip", self.tip), *((f"tips.{name}", each) for name, each in self.tips.items())):
            _check(f"{entry}.body", tip.body if tip else None, self.bodies, "body")
        if self.tip is None and not self.tips:
            object.__setattr__(self, "tips", self.chain_ends())
        return self

    def _check_shapes(self) -> None:
        owner: dict[str, str] = {}
        for name, body in self.bodies.items():
            for shape in body.shapes:
                if shape in owner:
                    raise problem(f"bodies.{name}.shapes.{shape}", f"{owner[shape]} has a shape of this name")
                owner[shape] = name
        for pair in self.touching:
            for shape in pair:
                _check("touching", shape, owner, "shape")
            if owner[pair[0]] == owner[pair[1]]:
                raise problem("touching", "shapes of one body do not touch each other", list(pair))

    def _check_paths(self) -> None:
        """Refuse inertia on joints with paths, which would act on what moves freely beside them."""
        for name, joint in self.joints.items():
            if joint.path is None:
                continue
            if joint.armature:
                raise problem(f"joints.{name}.armature", "has no effect on a joint with a path", joint.armature)
            carried = {joint.body}
            for key, body in self.bodies.items():
                carried |= {key} if body.parent in carried else set()
                if key in carried and (body.mass or any(body.inertia)):
                    allowed = f"is for joints that move no mass, and {key} has {body.mass:g} kg"
                    hint = "; make it the joint of a body without mass, and join that one to it by loops"
                    raise problem(f"joints.{name}.path", allowed + hint)

    def objects_at(self, keyframe: Keyframe | None) -> dict[str, Object]:
        """Return the objects as they are at a keyframe."""
        states = keyframe.objects if keyframe else {}
        moved = {name: self.objects[name].updated(**dict(state)) for name, state in states.items()}
        return self.objects | moved

    def cord(self, tendon: str, *, curvature_offset: float = 0.0, at_bends: bool = False) -> Cord:
        """Return a tendon as a cord: its arms on joints, where it winds about them, then the legs of its path.

        Some ``curvature_offset``, rad, is added to its own; with ``at_bends`` it rubs at each of its bends.
        """
        described = self.tendons[tendon]
        # A sum of joint positions that is no cord, or that stands beside a path, shows no bend.
        winds = float(described.path is None and self._is_cord(tendon))
        gains = (described.joints or {}).items()
        arms = (CordElement(joint, frozenset({joint}), -gain, winds) for joint, gain in gains if gain)
        (_, trunk), *branches = self._legs(described.path or {})
        return Cord(
            (*arms, *trunk),
            tuple(Cord(tuple(legs), divisor=divisor, at_bends=at_bends) for divisor, legs in branches),
            curvature_offset=described.curvature_offset + curvature_offset,
            through_space=described.path is not None,
            at_bends=at_bends,
        )

    @property
    def on_paths(self) -> dict[str, PathSignal]:
        """Paths of the joints that are moved along one, by name."""
        return {name: joint.path for name, joint in self.joints.items() if joint.path is not None}

    @property
    def tip_names(self) -> tuple[str, ...]:
        """Names of the fingertips where there are several; none of a single one."""
        return tuple(self.tips) if len(self.tips) > 1 else ()

    @property
    def fingertips(self) -> dict[str, Tip]:
        """Fingertips by name; a single one has none."""
        return dict(self.tips) if self.tip_names else {"": self.tip or next(iter(self.tips.values()))}

    def with_tip(self, name: str) -> Self:
        """Return the same tree with one of its fingertips alone."""
        return self.updated(tips={name: self.tips[name]})

    def link_of(self, body: str | None) -> str | None:
        """Return the body with joints that carries a body, which may be that one; None for the base."""
        jointed = {joint.body for joint in self.joints.values()}
        while body is not None and body not in jointed:
            body = self.bodies[body].parent
        return body

    def chain_ends(self) -> dict[str, Tip]:
        """Return the far ends of the bodies with joints that carry no others, by body."""
        jointed = dict.fromkeys(joint.body for joint in self.joints.values())
        carriers = {self.link_of(self.bodies[name].parent) for name in jointed}
        return {name: Tip(body=name, position=self._far_end(name)) for name in jointed if name not in carriers}

    def _far_end(self, link: str) -> tuple[float, float, float]:
        """Return the point of a link's solids and shapes that is farthest from its origin, in its frame, m.

        Of a sphere it is the centre, of a capsule and a cylinder an end of the axis, of a box the middle of a face.
        """
        frames, points = {link: (np.zeros(3), Rotation.identity())}, [np.zeros((1, 3))]
        for name, body in self.bodies.items():
            if name != link:
                if body.parent not in frames or self.link_of(name) != link:
                    continue
                place, turn = frames[body.parent]
                frames[name] = place + turn.apply(body.position), turn * Rotation.from_quat(body.orientation)
            place, turn = frames[name]
            solids: list[TreeSolid | BodyShape] = [*body.solids.values(), *body.shapes.values()]
            for solid in solids:
                inner = Rotation.from_quat(solid.orientation).apply(self._axis_ends(solid)) + solid.position
                points.append(place + turn.apply(inner))
        reached = np.round(np.concatenate(points), 15) + 0.0
        x, y, z = reached[np.argmax(np.round(np.linalg.norm(reached, axis=1), 9))].tolist()
        return x, y, z

    def _axis_ends(self, solid: TreeSolid | BodyShape) -> Array:
        """Return the ends of the axes of a solid, or the corners of a mesh, shape (k, 3), m, in its frame."""
        if isinstance(solid, TreeSolid) and solid.mesh is not None:
            return self.meshes[solid.mesh].unpacked()[0]
        return KINDS[solid.primitive].axis_ends(solid.sizes)

    def _legs(self, path: Mapping[str, Waypoint]) -> list[tuple[float, list[CordElement]]]:
        """Return divisor and legs of every part of a path; a leg crosses the joints that move only one of its ends."""
        parts: list[tuple[float, list[CordElement]]] = [(1.0, [])]
        before: Waypoint | None = None
        wrap: tuple[str, Waypoint] | None = None
        for key, waypoint in path.items():
            if waypoint.kind == "pulley":
                before = wrap = None
                parts.append((waypoint.divisor, []))
            elif waypoint.kind != "point":
                wrap = key, waypoint
            else:
                if before is not None:
                    legs, first = parts[-1][1], self.movers(before.body)
                    about = self.movers(wrap[1].body) if wrap else first
                    crossed = frozenset((self.movers(waypoint.body) ^ first) | (about ^ first))
                    name, ends = str(len(legs) + 1), (before, waypoint)
                    legs.append(CordElement(name, crossed, points=ends, wrap=wrap, follows=bool(legs)))
                before, wrap = waypoint, None
        return parts

    @cached_property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the tendons that rub: springs, ranges, actuators, couplings or what drives their joint pulls them.

        A sum of joint positions is a cord where it winds about hinges at radii; else it is a transmission.
        """
        pulled = {name for name, each in self.tendons.items() if each.stiffness > 0.0 or each.range is not None}
        pulled |= {*self.linked, *filter(self._is_driven, self.tendons)}
        return tuple(name for name in self.tendons if name in pulled and self._is_cord(name))

    def _is_cord(self, name: str) -> bool:
        around = self.tendons[name].wound.items()
        return all(self.joints[joint].kind == "hinge" and abs(radius) <= LARGEST_RADIUS for joint, radius in around)

    def _is_driven(self, name: str) -> bool:
        return bool(drivers(self.actuators, "tendon", name) or coupled(self.couplings, name))

    @cached_property
    def linked(self) -> dict[str, dict[str, float]]:
        """Shares of actuators' forces that pull a cord about the one joint that they drive, by cord and actuator.

        A model whose actuators turn joints says nothing of the cords that do it: those about a joint that pull the same
        way share its torque. Cords that have a spring, a coupling or an actuator of their own are left out.
        """
        shares = dict[str, dict[str, float]]()
        for name, (joint, radius) in self._only_joints.items():
            turning = drivers(self.actuators, "joint", joint)
            if turning and not self._is_driven(name) and not self.tendons[name].stiffness > 0.0:
                shared = radius * sum(at == joint and other * radius > 0.0 for at, other in self._only_joints.values())
                shares[name] = {key: -each.gear / shared for key, each in turning.items()}
        return shares

    @cached_property
    def opposed(self) -> frozenset[str]:
        """Names of the cords about a single joint that another one turns the other way."""
        ways = {(joint, radius > 0.0) for joint, radius in self._only_joints.values()}
        return frozenset(name for name, (joint, radius) in self._only_joints.items() if (joint, radius < 0.0) in ways)

    @cached_property
    def _only_joints(self) -> dict[str, tuple[str, float]]:
        """Joints and radii, m, of the cords that wind about one joint alone, by cord."""
        return {name: (*each.wound.items(),)[0] for name, each in self.tendons.items() if len(each.wound) == 1}

    def joints_of(self, body: str) -> list[str]:
        """Return the joints of a body on its parent, in order."""
        return [name for name, joint in self.joints.items() if joint.body == body]

    def movers(self, body: str | None) -> set[str]:
        """Return the joints that move a body."""
        movers = set[str]()
        while body is not None:
            movers |= {*self.joints_of(body)}
            body = self.bodies[body].parent
        return movers


#: What a finger of links has beside its own joints and tendons: nothing.
NO_TREE = Tree.model_construct(bodies={}, joints={})


def _check(entry: str, name: str | None, names: Iterable[str], kind: str) -> None:
    valid = list(names)
    if name is not None and name not in valid:
        hint = suggestion(name, valid)
        raise problem(entry, f"no such {kind}; there are {', '.join(valid) or 'none'}{hint}", name)
