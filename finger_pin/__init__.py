"""finger_pin: tendon-driven robot fingers whose tendons rub, stretch, go slack and stick.

import finger_pin as fp

result = fp.simulate(fp.load_scenario("fig6"))
"""

from finger_pin.exceptions import FingerPinError, InputError, IntegrationError, Interrupted
from finger_pin.finger import Finger
from finger_pin.loading import list_fingers, list_scenarios, load_finger, load_scenario, to_toml
from finger_pin.parameters import FingerDescription
from finger_pin.recording import load_result, save
from finger_pin.scenario import Scenario
from finger_pin.simulation import simulate

__all__ = [
    "Finger",
    "FingerDescription",
    "FingerPinError",
    "InputError",
    "IntegrationError",
    "Interrupted",
    "Scenario",
    "list_fingers",
    "list_scenarios",
    "load_finger",
    "load_result",
    "load_scenario",
    "save",
    "simulate",
    "to_toml",
]
