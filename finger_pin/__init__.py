"""finger_pin: tendon-driven robot fingers whose tendons rub, stretch, go slack and stick.

Start with `load_scenario` and `simulate`; `Finger` and `Simulator` serve loops of one's own. What is not here is in its
room: ``fp.plots``, ``fp.control``, ``fp.studies``, ``fp.analysis``, ``fp.views``, ``fp.exceptions``. Everything is
imported on first use; ``__init__.pyi`` is the list.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
