"""finger_pin: tendon-driven robot fingers whose tendons rub, stretch, go slack and stick.

Start with `load_scenario` and `simulate`; `Finger` and `Simulator` serve loops of one's own.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from finger_pin.description.loading import list_fingers, list_scenarios, load_finger, load_scenario, to_toml
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import (
    FingerPinError,
    InputError,
    IntegrationError,
    Interrupted,
    MicroDampingWarning,
    ScenarioWarning,
    SelfLockingWarning,
)

if TYPE_CHECKING:
    from finger_pin.analysis import (
        critical_friction,
        force_polytope,
        largest_force,
        self_locking_map,
        self_locking_margin,
        tension_for_force,
    )
    from finger_pin.control import (
        CompensatedController,
        JointCompensation,
        PassiveTensionLoop,
        PseudoInverse,
        TendonFeedforward,
        TorqueLaw,
        build_controller,
    )
    from finger_pin.control.limited_distribution import LimitedDistribution
    from finger_pin.mechanism.finger import Finger
    from finger_pin.mechanism.mjcf import to_mjcf
    from finger_pin.simulation.convergence import Convergence, check_convergence
    from finger_pin.simulation.recording import load_result, save
    from finger_pin.simulation.simulate import simulate
    from finger_pin.simulation.simulator import Simulator
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
    from finger_pin.studies.many import simulate_many
    from finger_pin.views.plots import (
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
    from finger_pin.views.viewer import LiveView, view, view_forces, write_animation

# What needs Pinocchio, the compiler or matplotlib is imported when it is first asked for.
_LATER = {
    "CompensatedController": "control",
    "Convergence": "simulation.convergence",
    "DaskCluster": "studies",
    "Effort": "studies",
    "Finger": "mechanism.finger",
    "Grid": "studies",
    "JointCompensation": "control",
    "LatinHypercube": "studies",
    "LimitedDistribution": "control.limited_distribution",
    "Listing": "studies",
    "LiveView": "views.viewer",
    "LocalProcesses": "studies",
    "Metric": "studies",
    "PassiveTensionLoop": "control",
    "PseudoInverse": "control",
    "Range": "studies",
    "Simulator": "simulation.simulator",
    "TendonFeedforward": "control",
    "TorqueLaw": "control",
    "Variable": "studies",
    "build_controller": "control",
    "check_convergence": "simulation.convergence",
    "critical_friction": "analysis",
    "draw_all": "views.plots",
    "force_polytope": "analysis",
    "largest_force": "analysis",
    "load_result": "simulation.recording",
    "optimise": "studies",
    "plot_convergence": "views.plots",
    "plot_critical_friction": "views.plots",
    "plot_energy": "views.plots",
    "plot_fig6": "views.plots",
    "plot_force_polytope": "views.plots",
    "plot_friction_law": "views.plots",
    "plot_losses": "views.plots",
    "plot_pareto": "views.plots",
    "plot_radius_sensitivity": "views.plots",
    "plot_runaway": "views.plots",
    "plot_self_locking_map": "views.plots",
    "plot_sweep": "views.plots",
    "plot_workspace": "views.plots",
    "save": "simulation.recording",
    "self_locking_map": "analysis",
    "self_locking_margin": "analysis",
    "simulate": "simulation.simulate",
    "simulate_many": "studies.many",
    "sweep": "studies",
    "tension_for_force": "analysis",
    "to_mjcf": "mechanism.mjcf",
    "view": "views.viewer",
    "view_forces": "views.viewer",
    "write_animation": "views.viewer",
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
    "MicroDampingWarning",
    "PassiveTensionLoop",
    "PseudoInverse",
    "Range",
    "Scenario",
    "ScenarioWarning",
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
