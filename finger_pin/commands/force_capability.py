"""The command force-capability: the forces that a fingertip can exert."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finger_pin.commands.console import print_text, shows_progress
from finger_pin.commands.options import Format, Output, number, numbers
from finger_pin.exceptions import InputError

if TYPE_CHECKING:
    from finger_pin.mechanism.finger import Finger
    from finger_pin.typing import Array

# Of degrees, rad.
_ROUNDING = 1e-9


def force_capability(
    finger: Annotated[
        str, typer.Argument(metavar="FINGER", help="Finger, or scenario that has it: name, or path of a .toml file.")
    ] = "ub",
    posture: Annotated[
        str | None, typer.Option(metavar="DEG,DEG,...", help="Joint angles; default a third of each range.")
    ] = None,
    limit: Annotated[
        str, typer.Option(metavar="N|servos", help="Greatest tension, or servos for that of the finger's motors.")
    ] = "20",
    force: Annotated[str, typer.Option(metavar="X,Y,Z", help="The force whose tensions are printed, N.")] = "0,0,1",
    tip: Annotated[str | None, typer.Option(metavar="NAME", help="Fingertip, where a tree has several.")] = None,
    output: Output = Path("results/force_capability"),
    format: Format = None,
    view: Annotated[bool, typer.Option("--view", help="Show the forces at the fingertip in the viewer.")] = False,
) -> None:
    """Report and draw the forces that a fingertip can exert at a posture, and the tension that one force needs."""
    shows_progress(quiet=False)
    degrees = None if posture is None else numbers("--posture", posture)
    target_force = numbers("--force", force)
    limits: float | tuple[float, ...] = () if limit == "servos" else number("--limit", limit, positive=True)
    import numpy as np

    import finger_pin as fp
    from finger_pin.analysis import Friction, force_polytope, tension_for_force, tension_limits
    from finger_pin.description.loading import describe
    from finger_pin.description.validation import finite_vector
    from finger_pin.mechanism.coerce import at_tip, one_finger
    from finger_pin.views.plots import plot_force_polytope, plot_radius_sensitivity, save_figure

    finite_vector("--force", target_force, 3)
    one_finger(description := describe(finger))
    model = at_tip(fp.Finger(description), tip)
    if limit == "servos":
        limits = tension_limits(model)
        if not np.isfinite(limits).all():
            raise InputError("--limit", "every tendon needs an actuator, or give a number", limit)
    angles = _posture(model, degrees)
    tensions = {friction: tension_for_force(model, angles, target_force, friction=friction) for friction in Friction}
    polytope = force_polytope(model, angles, limits)
    figures = {
        "forces": plot_force_polytope(model, angles, limits),
        "sensitivity": plot_radius_sensitivity(model, angles, target_force),
    }
    for name, figure in figures.items():
        save_figure(figure, output / name, format)
    lines = [f"Largest tension for a force of {np.linalg.norm(target_force):g} N, N"]
    lines += [f"  friction {friction.value:10} {tension.largest:8.3f}" for friction, tension in tensions.items()]
    if limit == "servos":
        motor_limits = zip(model.routing.tendons, tension_limits(model), strict=False)
        lines += [
            "Greatest tension that motors can pull, N",
            *(f"  {name:19} {tension:8.3f}" for name, tension in motor_limits),
        ]
    print_text("\n".join([*lines, f"Figures are in {output}"]))
    if view:
        from finger_pin.views.viewer import view_forces

        view_forces(model.description, polytope, tension=tensions[Friction.NONE].strands, block=True)


def _posture(finger: Finger, degrees: list[float] | None) -> Array:
    """Return the angles of the joints, shape (n,), rad, by default a third of their ranges; refuse any beyond these."""
    import numpy as np

    limiter, joints = finger.stroke_limiter, finger.routing.joints
    if degrees is None:
        return limiter.lower + (limiter.upper - limiter.lower) / 3.0
    if len(degrees) != len(joints):
        allowed = f"must be {len(joints)} angles with commas between, one per joint ({', '.join(joints)})"
        raise InputError("--posture", allowed, degrees)
    angles = np.deg2rad(degrees)
    for joint, angle, low, high in zip(joints, angles, limiter.lower, limiter.upper, strict=True):
        if not low - _ROUNDING <= angle <= high + _ROUNDING:
            allowed = f"{joint} must be from {np.rad2deg(low):.4g} to {np.rad2deg(high):.4g} deg, the joint's range"
            raise InputError("--posture", allowed, degrees)
    return angles
