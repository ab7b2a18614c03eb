"""Actuators of a MuJoCo model, muscles or affine in control, its lag, length and speed; others are listed."""

from __future__ import annotations

import numpy as np
from pydantic import ValidationError

from finger_pin.description.caching import cached_property
from finger_pin.description.tree import LARGEST_RADIUS
from finger_pin.description.tree_actuators import Muscle
from finger_pin.exchange.mujoco_equalities import coupled_tendons
from finger_pin.exchange.mujoco_names import Table, model_name, unused_name
from finger_pin.exchange.mujoco_sites import at_site, moves_site, target_kind, target_problem
from finger_pin.exchange.mujoco_unsupported import ElementReader, is_disabled
from finger_pin.typing import Array

# Limit of a force that has none, N.
_LARGEST_FORCE = 1e9


def _affine(gain: float, offset: float, by_length: float, by_speed: float) -> Table:
    return {"gain": gain, "offset": offset, "by_length": by_length, "by_speed": by_speed}


# The attributes of MuJoCo's PID plugin, in order.
_PID = ("kp", "ki", "kd", "imax", "slewmax")


def _pid(kp: float, ki: float, kd: float, limit: float, slew: float, offset: float = 0.0) -> Table | str:
    """Return the law of a PID actuator, with the derivative of the length alone, or the reason for its lack.

    Args:
        kp: Proportional gain.
        ki: Gain of the sum of the error.
        kd: Gain of the speed.
        limit: Of the sum of the error; 0 for no limit.
        slew: Largest rate of its input; 0 for no limit.
        offset: Force without input at length zero.
    """
    if ki and slew:
        return "its PID limits the rate of its input, and has an integral part"
    law = _affine(kp, offset, -kp, -kd)
    if slew:
        law["slew"] = slew
    if ki:
        law["integral"] = ki
    return law | ({"state_range": [-limit, limit]} if ki and limit else {})


class ActuatorReader(ElementReader):
    """Reads actuators."""

    @cached_property
    def laws(self) -> dict[int, Table]:
        """Supported actuator laws as entries of a description; unsupported ones are listed."""
        laws = {}
        for i in range(getattr(self.model, "nactuator", self.model.nu)):
            reason = is_disabled(self.mujoco, self.model, i) or target_problem(self, i)
            law = self._law(i) if reason is None else reason
            law = at_site(self, i, law) if isinstance(law, dict) and self._drives(i)[0] == "site" else law
            if isinstance(law, str):
                self._leave_out(i, law)
            else:
                laws[i] = law | self._delay(i)
        return laws

    @cached_property
    def tendon_motors(self) -> list[int]:
        """The motors that can only pull a tendon, through space or around joints."""
        return [i for i in self.laws if self._only_pulls(i)]

    def table(self) -> Table:
        """Return all actuators but the motors that only pull tendons, by name."""
        model, actuators = self.model, {}
        self._list_shared_limits()
        for i in self.laws:
            if i in self.tendon_motors:
                continue
            kind, target = self._drives(i)
            named = {"joint": self.names.joints, "tendon": self.names.tendons}
            actuators[i] = {
                **({kind: named[kind][target]} if kind in named else {}),
                "gear": float(model.actuator_gear[i, 0]),
                **self.laws[i],
            }
            if model.actuator_ctrllimited[self._control(i)]:
                limits = model.actuator_ctrlrange[self._control(i)]
                limits = np.clip(limits, 0.0, 1.0) if "muscle" in actuators[i] else limits
                actuators[i]["input_range"] = limits.tolist()
            force_range = self._force_limits(i)
            if np.isfinite(force_range).any() and "muscle" in actuators[i]:
                self._leave_out(i, "the limit on a muscle's force")
            elif np.isfinite(force_range).any():
                actuators[i]["force_range"] = np.clip(force_range, -_LARGEST_FORCE, _LARGEST_FORCE).tolist()
        return {self.names.actuators[i]: actuator for i, actuator in actuators.items()}

    def inputs(self, controls: Array) -> dict[str, float]:
        """Return the inputs for a model's controls, by the names of actuators and of tendons that are pulled."""
        inputs = {}
        for i in sorted(self.laws, key=self.tendon_motors.__contains__):
            value = float(controls[self._control(i)])
            tension_per_input = -float(self.model.actuator_gear[i, 0]) * self.laws[i].get("gain", 0.0)
            inputs[self._name(i)] = value * tension_per_input if i in self.tendon_motors else value
        return inputs

    def _leave_out(self, i: int, reason: str) -> None:
        self.left_out.add(f"actuator {model_name(self.model, 'actuator', i)}: {reason}")

    def pulled_tendons(self) -> Table:
        """Return the tendons that motors pull, by the names of these."""
        tendons = {}
        for i in self.tendon_motors:
            name, tendon = self._name(i), int(self.model.actuator_trnid[i, 0])
            same = name == self.names.tendons[tendon]
            tendons[name] = self._route(tendon, same) | {"maximum_tension": float(max(self._tension_ends(i)))}
        return tendons

    def _name(self, i: int) -> str:
        """Return the name of an actuator, made unique if a motor has that of a tendon it does not pull."""
        name, tendons = self.names.actuators[i], self.names.tendons
        if i not in self.tendon_motors or name == tendons[self.model.actuator_trnid[i, 0]]:
            return name
        return name if name not in tendons else unused_name(name, {*self.names.actuators, *tendons}, "motor")

    def _tension_ends(self, i: int) -> Array:
        """Return the tensions of a motor at both ends of its control's range, within its limits, shape (2,), N."""
        exerted = self.laws[i]["gain"] * self.model.actuator_ctrlrange[self._control(i)]
        return np.asarray(-self.model.actuator_gear[i, 0] * np.clip(exerted, *self._force_limits(i)))

    def _force_limits(self, i: int) -> tuple[float, float]:
        """Return the limits of an actuator's force, its own and those of the joint or tendon that it alone drives."""
        model, (kind, target), gear = self.model, self._drives(i), float(self.model.actuator_gear[i, 0])
        low, high = model.actuator_forcerange[i] if model.actuator_forcelimited[i] else (-np.inf, np.inf)
        prefix = "tendon_actfrc" if kind == "tendon" else "jnt_actfrc"
        is_limited = kind != "site" and getattr(model, f"{prefix}limited")[target]
        if is_limited and gear and self._drivers(kind, target) == [i]:
            ends = sorted(getattr(model, f"{prefix}range")[target] / gear)
            low, high = max(low, ends[0]), min(high, ends[1])
        return float(low), float(high)

    def _list_shared_limits(self) -> None:
        """List the joints and tendons with a limit on what actuators exert, other than that of their only drive."""
        model = self.model
        for kind, limited in (("joint", model.jnt_actfrclimited), ("tendon", model.tendon_actfrclimited)):
            for target in (int(each) for each in np.flatnonzero(limited)):
                drivers, name = self._drivers(kind, target), model_name(model, kind, target)
                if len(drivers) > 1 or any(self._drives(i) != (kind, target) for i in drivers):
                    self.left_out.add(f"{kind} {name}: a limit on what actuators exert on it together")
                if kind == "joint" and model.jnt_actgravcomp[target] and model.body_gravcomp.any():
                    reason = "its gravity compensation counts as its actuators', which are limited"
                    self.left_out.add(f"joint {name}: {reason}")

    def _drivers(self, kind: str, target: int) -> list[int]:
        """Return the actuators that exert a force on a tendon, or on a joint by itself, by tendons or at sites."""
        targets = {(kind, target)}
        if kind == "joint":
            dof = int(self.model.jnt_dofadr[target])
            targets |= {("tendon", i) for i, moved in enumerate(self._moved_dofs) if dof in moved}
        at_sites = {i for i in self.laws if kind == "joint" and moves_site(self, i, target)}
        return [i for i in self.laws if self._drives(i) in targets or i in at_sites]

    @cached_property
    def _moved_dofs(self) -> list[set[int]]:
        """The degrees of freedom that each tendon's force acts on."""
        data = self.mujoco.MjData(self.model)
        self.mujoco.mj_fwdPosition(self.model, data)
        # Older versions have the pattern in the data.
        source = self.model if hasattr(self.model, "ten_J_rowadr") else data
        first, count, column = source.ten_J_rowadr, source.ten_J_rownnz, source.ten_J_colind
        return [set(column.ravel()[a : a + n].tolist()) for a, n in zip(first, count, strict=True)]

    def _drives(self, i: int) -> tuple[str, int]:
        """Return the kind and number of what an actuator drives."""
        return target_kind(self, i), int(self.model.actuator_trnid[i, 0])

    def _route(self, tendon: int, same_name: bool) -> Table:
        """Return the path of a tendon; if it has another name, the joints that it crosses and that bend it."""
        fixed_joints = self._fixed_joints(tendon)
        if same_name or not fixed_joints:
            return {"along": self.names.tendons[tendon]}
        return {"crossings": {self.names.joints[j]: {"radius": -arm, "bends": True} for j, arm in fixed_joints.items()}}

    def _fixed_joints(self, tendon: int) -> dict[int, float]:
        """Return the joints that a fixed tendon runs over, and its coefficients; none of one through space."""
        model = self.model
        pieces = range(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))
        fixed = model.wrap_type[pieces[0]] == self.mujoco.mjtWrap.mjWRAP_JOINT
        return {int(model.wrap_objid[k]): float(model.wrap_prm[k]) for k in pieces} if fixed else {}

    def _law(self, i: int) -> Table | str:
        """Return an actuator's law as in `laws`, or the reason for its lack."""
        model, gains, biases = self.model, self.mujoco.mjtGain, self.mujoco.mjtBias
        if model.actuator_plugin[i] >= 0:
            return self._plugin(i)
        kind = gains(int(model.actuator_gaintype[i])).name.removeprefix("mjGAIN_").lower()
        gain, bias = model.actuator_gainprm[i].tolist(), model.actuator_biasprm[i].tolist()
        if kind == "muscle":
            return self._muscle(i)
        if kind == "pid" and not any(bias[3:]):
            limit, slew = model.actuator_dynprm[i, :2].tolist()
            return _pid(-bias[1], gain[0], -bias[2], limit, slew, bias[0])
        state = self._state(i)
        if isinstance(state, str):
            return state + (f", of kind {kind}" if kind != "fixed" else "")
        if kind == "dcmotor" and not (any(gain[2:]) or any(bias) or np.any(model.actuator_dynprm[i]) or state):
            resistance, constant = gain[:2]
            return _affine(constant / resistance, 0.0, 0.0, -(constant**2) / resistance)
        if kind != "fixed":
            return f"its gain is not constant, but of kind {kind}"
        if model.actuator_biastype[i] not in (int(biases.mjBIAS_NONE), int(biases.mjBIAS_AFFINE)):
            return "its bias is not affine"
        affine = model.actuator_biastype[i] == biases.mjBIAS_AFFINE
        return _affine(gain[0], *(bias[:3] if affine else (0.0, 0.0, 0.0))) | state

    def _muscle(self, i: int) -> Table | str:
        """Return the numbers of a muscle, or the reason for their lack."""
        model, gain = self.model, self.model.actuator_gainprm[i]
        same_bias = np.array_equal(gain[:9], model.actuator_biasprm[i, :9])
        is_muscle = model.actuator_biastype[i] == self.mujoco.mjtBias.mjBIAS_MUSCLE and model.actuator_actnum[i] == 1
        if not (same_bias and is_muscle and model.actuator_dyntype[i] == self.mujoco.mjtDyn.mjDYN_MUSCLE):
            return "only a part of it is a muscle"
        if model.actuator_actlimited[i] and (model.actuator_actrange[i] != [0.0, 1.0]).any():
            return "the activation of a muscle is limited to other than 0 and 1"
        lengths, (rising, falling, smoothing) = model.actuator_lengthrange[i], model.actuator_dynprm[i, :3]
        muscle: Table = {
            "force": float(gain[2] if gain[2] >= 0.0 else gain[3] / model.actuator_acc0[i]),
            "length_range": lengths.tolist(),
            "range": gain[:2].tolist(),
            **dict(zip(("lmin", "lmax", "vmax", "fpmax", "fvmax"), gain[4:9].tolist(), strict=True)),
            "time_constants": [float(rising), float(falling)],
            "smoothing": float(smoothing),
        }
        try:
            Muscle.model_validate(muscle)
        except ValidationError as error:
            first = error.errors()[0]
            return f"a muscle of other numbers ({'.'.join(map(str, first['loc']))}: {first['msg']})"
        return {"muscle": muscle}

    def _state(self, i: int) -> Table | str:
        """Return the lag of an actuator, or that its input is a rate; nothing without a state."""
        model, dynamics = self.model, self.mujoco.mjtDyn
        if not model.actuator_actnum[i]:
            return {}
        kind, numbers = int(model.actuator_dyntype[i]), model.actuator_dynprm[i]
        limits: Table = {"state_range": model.actuator_actrange[i].tolist()} if model.actuator_actlimited[i] else {}
        if kind in (int(dynamics.mjDYN_FILTER), int(dynamics.mjDYN_FILTEREXACT)) and numbers[0] > 0.0:
            return {"time_constant": float(numbers[0]), **limits}
        if kind == int(dynamics.mjDYN_INTEGRATOR) and model.actuator_actnum[i] == 1:
            return {"integrates": True, **limits}
        return "it has dynamics of its own"

    def _plugin(self, i: int) -> Table | str:
        """Return the law of MuJoCo's PID plugin, with the derivative of the length alone."""
        model, instance = self.model, int(self.model.actuator_plugin[i])
        first = int(model.plugin_attradr[instance])
        texts = bytes(model.plugin_attr)[first:].split(b"\0")[: len(_PID)]
        numbers = {key: float(text) for key, text in zip(_PID, (each.decode() for each in texts), strict=False) if text}
        if self.names.plugins[instance : instance + 1] != ["mujoco.pid"]:
            return "a plugin computes it"
        if model.actuator_dyntype[i] != self.mujoco.mjtDyn.mjDYN_NONE:
            return "its PID has an input that comes late"
        kp, ki, kd, limit, slew = (numbers.get(key, 0.0) for key in _PID)
        # The plugin limits the force of the sum, actuators of kind pid the sum itself.
        return _pid(kp, ki, kd, limit / (ki or 1.0), slew)

    def _delay(self, i: int) -> Table:
        delay = getattr(self.model, "actuator_delay", None)
        return {} if delay is None or delay[i] <= 0.0 else {"delay": float(delay[i])}

    def _control(self, i: int) -> int:
        """Return the control of an actuator; those before it may have several, or none."""
        first = getattr(self.model, "actuator_ctrladr", None)
        return i if first is None else int(first[i])

    def _only_pulls(self, i: int) -> bool:
        model, mujoco = self.model, self.mujoco
        tendon, control = int(model.actuator_trnid[i, 0]), self._control(i)
        if (
            model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON
            or set(key for key, value in self.laws[i].items() if value) - {"gain"}
            or not model.actuator_ctrllimited[control]
        ):
            return False
        # What is no radius of a hinge is a transmission, and no tendon.
        for joint, arm in self._fixed_joints(tendon).items():
            if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE or abs(arm) > LARGEST_RADIUS:
                return False
        ends = self._tension_ends(i)
        # One that never lets go, or whose tendon another holds, has a range of inputs, as other actuators.
        return bool(np.min(ends) == 0.0 and np.any(ends) and tendon not in coupled_tendons(mujoco, model))
