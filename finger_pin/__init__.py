"""finger_pin: tendon-driven robot fingers whose tendons rub, stretch, go slack and stick.

Start with `load_scenario` and `simulate`; `Finger` and `Simulator` serve loops of one's own.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from finger_pin.exceptions import FingerPinError, InputError, IntegrationError, Interrupted, SelfLockingWarning
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
    from finger_pin.controllers import (
        CompensatedController,
        JointCompensation,
        PassiveTensionLoop,
        PseudoInverse,
        TendonFeedforward,
        TorqueLaw,
        build_controller,
    )
    from finger_pin.controllers.limited_distribution import LimitedDistribution
    from finger_pin.convergence import Convergence, check_convergence
    from finger_pin.finger import Finger
    from finger_pin.many import simulate_many
    from finger_pin.mjcf import to_mjcf
    from finger_pin.plots import (
        draw_all,
        plot_convergence,
        plot_critical_friction,
        plot_energy,
        plot_fig6,
        plot_force_polytope,
        plot_friction_law,
        plot_losses,
        plot_pareto,
        plot_radius_sensitivity,
        plot_runaway,
        plot_self_locking_map,
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
    from finger_pin.viewer import LiveView, view, view_forces, write_animation

# What needs Pinocchio, the compiler or matplotlib is imported when it is first asked for.
_LATER = {
    "CompensatedController": "controllers",
    "Convergence": "convergence",
    "DaskCluster": "studies",
    "Effort": "studies",
    "Finger": "finger",
    "Grid": "studies",
    "JointCompensation": "controllers",
    "LatinHypercube": "studies",
    "LimitedDistribution": "controllers.limited_distribution",
    "Listing": "studies",
    "LiveView": "viewer",
    "LocalProcesses": "studies",
    "Metric": "studies",
    "PassiveTensionLoop": "controllers",
    "PseudoInverse": "controllers",
    "Range": "studies",
    "Simulator": "simulator",
    "TendonFeedforward": "controllers",
    "TorqueLaw": "controllers",
    "Variable": "studies",
    "build_controller": "controllers",
    "check_convergence": "convergence",
    "critical_friction": "analysis",
    "draw_all": "plots",
    "force_polytope": "analysis",
    "largest_force": "analysis",
    "load_result": "recording",
    "optimise": "studies",
    "plot_convergence": "plots",
    "plot_critical_friction": "plots",
    "plot_energy": "plots",
    "plot_fig6": "plots",
    "plot_force_polytope": "plots",
    "plot_friction_law": "plots",
    "plot_losses": "plots",
    "plot_pareto": "plots",
    "plot_radius_sensitivity": "plots",
    "plot_runaway": "plots",
    "plot_self_locking_map": "plots",
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
    "view_forces": "viewer",
    "write_animation": "viewer",
}

__all__ = [
    "CompensatedController",
    "Convergence",
    "DaskCluster",
    "Effort",
    "Finger",
    "FingerDescription",
    "FingerPinError",
    "Grid",
    "InputError",
    "IntegrationError",
    "Interrupted",
    "JointCompensation",
    "LatinHypercube",
    "LimitedDistribution",
    "Listing",
    "LiveView",
    "LocalProcesses",
    "Metric",
    "PassiveTensionLoop",
    "PseudoInverse",
    "Range",
    "Scenario",
    "SelfLockingWarning",
    "Simulator",
    "TendonFeedforward",
    "TorqueLaw",
    "Variable",
    "build_controller",
    "check_convergence",
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
    "plot_convergence",
    "plot_critical_friction",
    "plot_energy",
    "plot_fig6",
    "plot_force_polytope",
    "plot_friction_law",
    "plot_losses",
    "plot_pareto",
    "plot_radius_sensitivity",
    "plot_runaway",
    "plot_self_locking_map",
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
    "view_forces",
    "write_animation",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name in _LATER:
        return getattr(import_module(f"finger_pin.{_LATER[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
