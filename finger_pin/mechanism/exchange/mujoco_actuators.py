"""Actuators of a MuJoCo model whose force is affine in control, length and speed; the others are listed or refused."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from finger_pin.mechanism.exchange.mujoco_flags import undriven
from finger_pin.mechanism.exchange.mujoco_names import Table, distinct
from finger_pin.mechanism.exchange.mujoco_unsupported import ElementReader

# As `Crossing` has it, m.
_LARGEST_RADIUS = 0.5


class ActuatorReader(ElementReader):
    """Reads actuators."""

    @cached_property
    def laws(self) -> dict[int, tuple[float, float, float, float]]:
        """Force per control, force at rest, force per length and per speed, of the actuators that can be carried over.

        The others are listed.
        """
        found = {}
        for i in range(getattr(self.model, "nactuator", self.model.nu)):
            why = undriven(self.mujoco, self.model, i) or self._foreign(i)
            law = self._law(i) if why is None else why
            if isinstance(law, str):
                self.rest.add(f"actuator {self.model.actuator(i).name or f'actuator_{i}'}: {law}")
            else:
                found[i] = law
        return found

    @cached_property
    def pulling(self) -> list[int]:
        """The motors that can only pull a tendon, through space or around joints."""
        return [i for i in self.laws if self._pulls(i)]

    def table(self) -> Table:
        """Return all others, by name."""
        model, found = self.model, {}
        for i in self.laws:
            if i in self.pulling:
                continue
            kind, at = model.actuator_trntype[i], int(model.actuator_trnid[i, 0])
            of_tendon = kind == self.mujoco.mjtTrn.mjTRN_TENDON
            gain, offset, by_length, by_speed = self.laws[i]
            found[i] = {
                **({"tendon": self.names.tendons[at]} if of_tendon else {"joint": self.names.joints[at]}),
                "gear": float(model.actuator_gear[i, 0]),
                "gain": gain,
                "offset": offset,
                "by_length": by_length,
                "by_speed": by_speed,
            }
            if model.actuator_ctrllimited[self._control(i)]:
                found[i]["input_range"] = model.actuator_ctrlrange[self._control(i)].tolist()
            if model.actuator_forcelimited[i]:
                found[i]["force_range"] = model.actuator_forcerange[i].tolist()
        names = distinct("actuator", [model.actuator(i).name for i in found])
        return dict(zip(names, found.values(), strict=True))

    def pulled(self) -> Table:
        """Return the tendons that motors pull, by the names of these."""
        model = self.model
        names = distinct("actuator", [model.actuator(i).name for i in self.pulling])
        return {name: self._route(int(model.actuator_trnid[i, 0])) for name, i in zip(names, self.pulling, strict=True)}

    def _route(self, tendon: int) -> Table:
        """Return the path of a tendon, or the joints that it crosses, which all bend it."""
        around = self._around(tendon)
        if not around:
            return {"along": self.names.tendons[tendon]}
        return {"crossings": {self.names.joints[j]: {"radius": -arm, "bends": True} for j, arm in around.items()}}

    def _around(self, tendon: int) -> dict[int, float]:
        """Return the joints that a fixed tendon runs over, and its coefficients; none of one through space."""
        model = self.model
        pieces = range(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))
        fixed = model.wrap_type[pieces[0]] == self.mujoco.mjtWrap.mjWRAP_JOINT
        return {int(model.wrap_objid[k]): float(model.wrap_prm[k]) for k in pieces} if fixed else {}

    def _foreign(self, i: int) -> str | None:
        """Return the reason against carrying an actuator's target or computation over, or None."""
        model, mujoco = self.model, self.mujoco
        driven = mujoco.mjtTrn(int(model.actuator_trntype[i])).name.removeprefix("mjTRN_").lower()
        if driven not in ("joint", "jointinparent", "tendon"):
            return f"it drives a {driven}"
        if driven != "tendon" and model.jnt_type[model.actuator_trnid[i, 0]] == mujoco.mjtJoint.mjJNT_FREE:
            return "it drives a free joint"
        return "a plugin computes it" if model.actuator_plugin[i] >= 0 else None

    def _law(self, i: int) -> tuple[float, float, float, float] | str:
        """Return an actuator's law as in `laws`, or the reason for its lack."""
        model, gains, biases = self.model, self.mujoco.mjtGain, self.mujoco.mjtBias
        kind = gains(int(model.actuator_gaintype[i])).name.removeprefix("mjGAIN_").lower()
        gain, bias = model.actuator_gainprm[i].tolist(), model.actuator_biasprm[i].tolist()
        if model.actuator_actnum[i]:
            return "it has dynamics of its own" + (f", of kind {kind}" if kind != "fixed" else "")
        if kind == "dcmotor" and not (any(gain[2:]) or any(bias) or np.any(model.actuator_dynprm[i])):
            resistance, constant = gain[:2]
            return constant / resistance, 0.0, 0.0, -(constant**2) / resistance
        if kind == "pid" and not (any(gain) or any(bias[3:]) or np.any(model.actuator_dynprm[i])):
            return -bias[1], *bias[:3]
        if kind != "fixed":
            return f"its gain is not constant, but of kind {kind}"
        if model.actuator_biastype[i] not in (int(biases.mjBIAS_NONE), int(biases.mjBIAS_AFFINE)):
            return "its bias is not affine"
        affine = model.actuator_biastype[i] == biases.mjBIAS_AFFINE
        return gain[0], *(bias[:3] if affine else (0.0, 0.0, 0.0))

    def _control(self, i: int) -> int:
        """Return the control of an actuator; those before it may have several, or none."""
        first = getattr(self.model, "actuator_ctrladr", None)
        return i if first is None else int(first[i])

    def _pulls(self, i: int) -> bool:
        model, mujoco = self.model, self.mujoco
        at, control = int(model.actuator_trnid[i, 0]), self._control(i)
        if (
            model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON
            or any(self.laws[i][1:])
            or not model.actuator_ctrllimited[control]
            or model.actuator_forcelimited[i]
        ):
            return False
        # What is no radius of a hinge is a transmission, and no tendon.
        for joint, arm in self._around(at).items():
            if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE or abs(arm) > _LARGEST_RADIUS:
                return False
        exerted = model.actuator_gear[i, 0] * self.laws[i][0] * model.actuator_ctrlrange[control]
        return bool(np.all(exerted <= 0.0) and np.any(exerted))
