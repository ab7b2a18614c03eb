"""Friction of cords compared on a continuum robot: one MJCF, one recording, one metric, and only the friction differs.

The robot is `ftdcr_v4` of https://github.com/ContinuumRoboticsLab/opencr-mujoco (MIT): three segments, nine servos that
wind cords, and the tip by motion capture. A clone of that repository has the recordings and the generator of the MJCF,
with the angles and pretensions that its authors identified; none of it ships here. Every servo reading is replayed and
left to settle, and the error is theirs: root mean square of the tip's distance, after the mean offset is taken off. A
law has one coefficient for all cords, fitted to a part of their train recording; the validation recording is predicted.
"""

import argparse
import csv
import json
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import scipy

import finger_pin as fp
from finger_pin.exceptions import InputError

CONFIGURATION = "configs/generation/{}.json"
SESSION = "data/sysid/ftdcr_v4/tdcr_sysid_20260511-183002_analysis/tdcr_sysid_20260511-183002_{}.csv"
TIP = "force_site_tip"


class Law(NamedTuple):
    """A friction law of the cords with one coefficient.

    Attributes:
        add: Adds the friction of a coefficient to a model.
        bounds: Bounds of the coefficient, in its unit.
        servo_offset: Whether the coefficient is the offset of commands in m, as the repository has it.
    """

    add: Callable[[mujoco.MjSpec, float], None]
    bounds: tuple[float, float]
    unit: str = ""
    servo_offset: bool = False


class Recording(NamedTuple):
    """Settled readings of the robot.

    Attributes:
        wound: Cord that each servo has wound in (samples, cords), m, in the order of the model's actuators.
        tip: Position of the tip (samples, 3), m.
    """

    wound: np.ndarray
    tip: np.ndarray


def _add_loss(spec: mujoco.MjSpec, loss: float) -> None:
    for tendon in spec.tendons:
        tendon.frictionloss = loss
        # By default MuJoCo's loss creeps, and is gone before a reading has settled.
        tendon.solref_friction[:] = 0.004, 1.0
        tendon.solimp_friction[:2] = 0.9999, 0.9999


def _add_capstan(spec: mujoco.MjSpec, coulomb: float) -> None:
    if coulomb > 0.0:
        # At rest a coefficient and its ratio of stiction are one number.
        fp.mujoco.add_friction(spec, tendons={"*": {"coulomb": coulomb, "stiction_ratio": 1.0}})


LAWS = {
    "none": Law(lambda spec, _: None, (0.0, 0.0)),
    "constant loss": Law(_add_loss, (0.0, 2.0), "N"),
    "constant offset of servos": Law(lambda spec, _: None, (0.0, 0.001), "m", servo_offset=True),
    "capstan with bristles": Law(_add_capstan, (0.0, 0.3)),
}


def generate(clone: Path, configuration: str, target: Path) -> str:
    """Return the MJCF that the generator of a clone writes for a configuration of the robot."""
    path = clone / CONFIGURATION.format(configuration)
    if not path.is_file():
        raise InputError("clone", f"must be a clone of ContinuumRoboticsLab/opencr-mujoco, with {path.name}", clone)
    values = json.loads(path.read_text(encoding="utf-8"))
    values.setdefault("total_links", sum(int(each) for each in values["links_per_segment"].values()))
    values.setdefault("total_length", sum(float(each) for each in values["segment_lengths"].values()))
    sys.path.insert(0, str(clone))
    try:
        from opencr_mujoco.generators.unified_tdcr_generator import create_tdcr_from_config
    finally:
        sys.path.remove(str(clone))
    create_tdcr_from_config(values, str(target))
    return target.read_text(encoding="utf-8")


def read(path: Path, pulls: Path) -> Recording:
    """Return a recording; labels of the recording of single pulls say which servo winds which cord."""
    with pulls.open(encoding="utf-8") as file:
        labels = [re.search(r"tendon(\d+)_id(\d+)", row["pattern_label"]) for row in csv.DictReader(file)]
    servos = {int(match[1]): match[2] for match in labels if match}
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    wound = [[float(row[f"servo_{servos[cord]}_mm"]) for cord in sorted(servos)] for row in rows]
    return Recording(1e-3 * np.array(wound), 1e-3 * np.array([[float(row[f"tip_{x}"]) for x in "xyz"] for row in rows]))


def replay(xml: str, law: Law, coefficient: float, wound: np.ndarray, settling: float) -> np.ndarray:
    """Return the tip's positions (samples, 3), m, as every reading of the servos has settled.

    Raises:
        ArithmeticError: If the motion is unstable.
    """
    spec = mujoco.MjSpec.from_string(xml)
    # MuJoCo's noslip iterations would take the bristles away; without contact and loss they do nothing.
    spec.option.noslip_iterations = 0
    law.add(spec, coefficient)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("pretension").id)
    cords = wound.shape[1]
    start, steps = data.ctrl[:cords].copy(), round(settling / model.opt.timestep)
    if law.servo_offset:
        turns = np.tanh(1000.0 * np.diff(wound, axis=0, prepend=0.0))
        wound = wound - turns * np.maximum(coefficient, 0.0)
    tips = np.empty((len(wound), 3))
    for i, each in enumerate(wound):
        data.ctrl[:cords] = start - each
        mujoco.mj_step(model, data, steps)
        tips[i] = data.site(TIP).xpos
    if not np.isfinite(tips).all():
        raise ArithmeticError(f"the motion is unstable at a coefficient of {coefficient:g}")
    return tips


def tip_error(measured: np.ndarray, computed: np.ndarray) -> float:
    """Return the root mean square of distances (samples, 3), less their mean offset."""
    difference = measured - computed
    return float(np.sqrt(np.mean(np.sum((difference - difference.mean(axis=0)) ** 2, axis=1))))


def fit(xml: str, law: Law, recording: Recording, settling: float) -> tuple[float, float]:
    """Return the coefficient with the least tip error, and that error, m."""

    def error(coefficient: float) -> float:
        return tip_error(recording.tip, replay(xml, law, coefficient, recording.wound, settling))

    without = error(law.bounds[0])
    if law.bounds[0] == law.bounds[1]:
        return law.bounds[0], without
    options = {"maxiter": 7, "xatol": 0.02 * law.bounds[1]}
    best = scipy.optimize.minimize_scalar(error, bounds=law.bounds, method="bounded", options=options)
    # The search never tries its bounds, and no friction may be best.
    return (float(best.x), float(best.fun)) if best.fun < without else (law.bounds[0], without)


def main(arguments: list[str] | None = None) -> int:
    """Fit the laws to the train recording, predict the validation recording, and print both errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clone", type=Path, help="folder of a clone of ContinuumRoboticsLab/opencr-mujoco")
    parser.add_argument("--configuration", default="ftdcr_v4_sysid", help="of the robot (ftdcr_v4_sysid)")
    parser.add_argument("--only", choices=LAWS, metavar="LAW", help="one of: " + ", ".join(LAWS))
    parser.add_argument("--stride", type=int, default=8, help="fit every so many readings (8, as the authors do)")
    parser.add_argument("--settling", type=float, default=0.5, help="time for a reading to settle, s (0.5, as theirs)")
    options = parser.parse_args(arguments)
    try:
        with tempfile.TemporaryDirectory() as folder:
            xml = generate(options.clone, options.configuration, Path(folder) / "robot.xml")
        train, validation = (
            read(options.clone / SESSION.format(name), options.clone / SESSION.format("tendon_pull"))
            for name in ("train", "val")
        )
    except (InputError, OSError, KeyError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    part = Recording(*(each[:: options.stride] for each in train))
    print(f"{'law':28} {'coefficient':>14} {'train, mm':>10} {'validation, mm':>15}")
    for name in [options.only] if options.only else LAWS:
        law = LAWS[name]
        best, fitted = fit(xml, law, part, options.settling)
        predicted = tip_error(validation.tip, replay(xml, law, best, validation.wound, options.settling))
        print(f"{name:28} {best:12.4g} {law.unit:1} {1e3 * fitted:10.2f} {1e3 * predicted:15.2f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
