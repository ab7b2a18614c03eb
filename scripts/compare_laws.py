"""Laws of friction side by side on a bench: fitted to the same recordings, they predict the same held-out ones.

The laws are the ones that people have: none, a constant level, a constant and a viscous one, the capstan's without
bristles, and what the bench has as it stands.
"""

import argparse
import sys
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

import finger_pin as fp
from finger_pin.description.loading import load_bench

_TENDON, _JOINT, _GEARS = "finger.tendon_friction.", "finger.joint_friction.", "finger.actuators.servo.motor.friction."


class Law(NamedTuple):
    """A law as changes of a bench.

    Attributes:
        held: Numbers that it holds, by key; those keys are not searched for.
        searched: Bounds of further keys.
    """

    held: Mapping[str, float]
    searched: Mapping[str, tuple[float, float]] = {}


_NO_LOAD = {f"{_TENDON}coulomb": 0.0, f"{_JOINT}{{coulomb,stiction}}": 0.0}
_NO_SERVO = {f"{_GEARS}{name}": 0.0 for name in ("by_load", "stribeck_by_load", "viscous")}
#: Of every bench the laws beside its own.
LAWS: dict[str, dict[str, Law]] = {
    "transmission": {"constant": Law({f"{_TENDON}coulomb": 0.0}), "capstan": Law({f"{_TENDON}drag": 0.0})},
    "instrument": {
        "none": Law({**_NO_LOAD, f"{_JOINT}drag": 0.0, f"{_TENDON}stiffness": 1e5}),
        "constant": Law({**_NO_LOAD, f"{_TENDON}stiffness": 1e5}),
        "constant, viscous": Law({**_NO_LOAD, f"{_TENDON}stiffness": 1e5}, {f"{_JOINT}viscous": (1e-5, 0.1)}),
        "capstan, constant": Law({f"{_JOINT}{{coulomb,stiction}}": 0.0, f"{_TENDON}stiffness": 1e5}),
    },
    "servo_pendulum": {
        "none": Law({**_NO_SERVO, f"{_GEARS}coulomb": 0.0}),
        "constant": Law(_NO_SERVO),
        "constant, viscous": Law({key: 0.0 for key in _NO_SERVO if not key.endswith("viscous")}),
    },
}


def fitted(bench: str, law: Law, starts: int) -> xr.Dataset:
    """Return the identification of a bench under a law, with what it predicts."""
    scenario, settings = load_bench(bench)
    pinned = {}
    for key, value in law.held.items():
        owner, brace, names = key.partition("{")
        # Two numbers that move together are changed together.
        pinned |= {owner + name: value for name in names.strip("}").split(",")} if brace else {key: value}
    bounds = {key: each for key, each in settings.parameters.items() if key not in law.held}
    recordings = {name: each.model_dump(exclude_unset=True) for name, each in settings.recordings.items()}
    return fp.identify(
        fp.load_scenario(scenario, pinned),
        parameters=bounds | dict(law.searched),
        recordings=recordings,
        starts=starts,
        profiles=False,
    )


def by_variable(result: xr.Dataset, values: str, along: str) -> dict[str, float]:
    """Return the root mean square, or of shares the mean, of what is along signals, by their variable."""
    columns: dict[str, list[float]] = {}
    for name, value in zip(result[along].values.tolist(), result[values].values.tolist(), strict=True):
        columns.setdefault(name.split(".", 1)[1], []).append(value)
    shares = values == "prediction_within"
    return {
        name: float(np.mean(each) if shares else np.sqrt(np.mean(np.square(each)))) for name, each in columns.items()
    }


def main(arguments: list[str] | None = None) -> int:
    """Fit a bench under every law; print what each leaves over, and how well it predicts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bench", choices=LAWS)
    parser.add_argument("--starts", type=int, default=1, metavar="N", help="from how many points to search")
    options = parser.parse_args(arguments)
    print(f"{'law':20} numbers  signal, rms fitted, rms held out, share of held-out samples in the 95 % band")
    for name, law in {**LAWS[options.bench], "as described": Law({})}.items():
        result = fitted(options.bench, law, options.starts)
        noise = by_variable(result, "noise", "signal")
        predicts = "prediction_rms" in result
        rms = by_variable(result, "prediction_rms", "prediction") if predicts else {}
        within = by_variable(result, "prediction_within", "prediction") if predicts else {}
        print(f"{name:20} {result.sizes['parameter']:7}", flush=True)
        for signal, value in noise.items():
            predicted = f"{rms[signal]:9.3g} {within[signal]:7.0%}" if signal in rms else ""
            print(f"{'':29} {signal:34} {value:9.3g} {predicted}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
