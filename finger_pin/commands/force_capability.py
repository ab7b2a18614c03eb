"""The command force-capability: the forces that a fingertip can exert."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finger_pin.commands.console import print_text, talks
from finger_pin.commands.options import Format, Output, number, numbers

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
    talks(quiet=False)
    degrees = None if posture is None else numbers("--posture", posture)
    wish = numbers("--force", force)
    most: float | tuple[float, ...] = () if limit == "servos" else number("--limit", limit, positive=True)
    import numpy as np

    import finger_pin as fp
    from finger_pin.analysis import Friction, force_polytope, tension_for_force, tension_limits
    from finger_pin.description.loading import describe
    from finger_pin.description.validation import finite_vector
    from finger_pin.mechanism.coerce import at_tip, one_finger
    from finger_pin.views.plots import plot_force_polytope, plot_radius_sensitivity, save_figure

    finite_vector("--force", wish, 3)
    one_finger(described := describe(finger))
    built = at_tip(fp.Finger(described), tip)
    if limit == "servos":
        most = tension_limits(built)
        if not np.isfinite(most).all():
            raise fp.InputError("--limit", "every tendon needs an actuator, or give a number", limit)
    limiter, joints = built.stroke_limiter, built.routing.joints
    angles = limiter.lower + (limiter.upper - limiter.lower) / 3.0 if degrees is None else np.deg2rad(degrees)
    if len(angles) != len(joints):
        allowed = f"must be {len(joints)} angles with commas between, one per joint ({', '.join(joints)})"
        raise fp.InputError("--posture", allowed, degrees)
    for joint, angle, low, high in zip(joints, angles, limiter.lower, limiter.upper, strict=True):
        if not low - _ROUNDING <= angle <= high + _ROUNDING:
            allowed = f"{joint} must be from {np.rad2deg(low):.4g} to {np.rad2deg(high):.4g} deg, the joint's range"
            raise fp.InputError("--posture", allowed, degrees)
    needed = {each: tension_for_force(built, angles, wish, friction=each) for each in Friction}
    polytope = force_polytope(built, angles, most)
    figures = {
        "forces": plot_force_polytope(built, angles, most),
        "sensitivity": plot_radius_sensitivity(built, angles, wish),
    }
    for name, figure in figures.items():
        save_figure(figure, output / name, format)
    lines = [f"Largest tension for a force of {np.linalg.norm(wish):g} N, N"]
    lines += [f"  friction {friction.value:10} {required.largest:8.3f}" for friction, required in needed.items()]
    if limit == "servos":
        pulled = zip(built.routing.tendons, tension_limits(built), strict=False)
        lines += ["Greatest tension that motors can pull, N", *(f"  {name:19} {each:8.3f}" for name, each in pulled)]
    print_text("\n".join([*lines, f"Figures are in {output}"]))
    if view:
        from finger_pin.views.viewer import view_forces

        view_forces(built.description, polytope, tension=needed[Friction.NONE].strands, block=True)
