"""finger_pin: tendon-driven robot fingers whose tendons rub, stretch, go slack and stick.

Start with `load_scenario` and `simulate`; `Finger` and `Simulator` serve loops of one's own.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from finger_pin.exceptions import FingerPinError, InputError, IntegrationError, Interrupted
from finger_pin.loading import list_fingers, list_scenarios, load_finger, load_scenario, to_toml
from finger_pin.parameters import FingerDescription
from finger_pin.scenario import Scenario

if TYPE_CHECKING:
    from finger_pin.analysis import (
        critical_friction,
        force_polytope,
        largest_force,
        self_locking_map,
        self_locking_margin,
        tension_for_force,
    )
    from finger_pin.finger import Finger
    from finger_pin.many import simulate_many
    from finger_pin.mjcf import to_mjcf
    from finger_pin.plots import (
        draw_all,
        plot_energy,
        plot_fig6,
        plot_friction_law,
        plot_losses,
        plot_pareto,
        plot_sweep,
        plot_workspace,
    )
    from finger_pin.recording import load_result, save
    from finger_pin.simulation import simulate
    from finger_pin.simulator import Simulator
    from finger_pin.studies import (
        DaskCluster,
        Effort,
        Grid,
        LatinHypercube,
        Listing,
        LocalProcesses,
        Metric,
        Range,
        Variable,
        optimise,
        sweep,
    )
    from finger_pin.viewer import LiveView, view, write_animation

# What needs Pinocchio, the compiler or matplotlib is imported when it is first asked for.
_LATER = {
    "DaskCluster": "studies",
    "Effort": "studies",
    "Finger": "finger",
    "Grid": "studies",
    "LatinHypercube": "studies",
    "Listing": "studies",
    "LiveView": "viewer",
    "LocalProcesses": "studies",
    "Metric": "studies",
    "Range": "studies",
    "Simulator": "simulator",
    "Variable": "studies",
    "critical_friction": "analysis",
    "draw_all": "plots",
    "force_polytope": "analysis",
    "largest_force": "analysis",
    "load_result": "recording",
    "optimise": "studies",
    "plot_energy": "plots",
    "plot_fig6": "plots",
    "plot_friction_law": "plots",
    "plot_losses": "plots",
    "plot_pareto": "plots",
    "plot_sweep": "plots",
    "plot_workspace": "plots",
    "save": "recording",
    "self_locking_map": "analysis",
    "self_locking_margin": "analysis",
    "simulate": "simulation",
    "simulate_many": "many",
    "sweep": "studies",
    "tension_for_force": "analysis",
    "to_mjcf": "mjcf",
    "view": "viewer",
    "write_animation": "viewer",
}

__all__ = [
    "DaskCluster",
    "Effort",
    "Finger",
    "FingerDescription",
    "FingerPinError",
    "Grid",
    "InputError",
    "IntegrationError",
    "Interrupted",
    "LatinHypercube",
    "Listing",
    "LiveView",
    "LocalProcesses",
    "Metric",
    "Range",
    "Scenario",
    "Simulator",
    "Variable",
    "critical_friction",
    "draw_all",
    "force_polytope",
    "largest_force",
    "list_fingers",
    "list_scenarios",
    "load_finger",
    "load_result",
    "load_scenario",
    "optimise",
    "plot_energy",
    "plot_fig6",
    "plot_friction_law",
    "plot_losses",
    "plot_pareto",
    "plot_sweep",
    "plot_workspace",
    "save",
    "self_locking_map",
    "self_locking_margin",
    "simulate",
    "simulate_many",
    "sweep",
    "tension_for_force",
    "to_mjcf",
    "to_toml",
    "view",
    "write_animation",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name in _LATER:
        return getattr(import_module(f"finger_pin.{_LATER[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
