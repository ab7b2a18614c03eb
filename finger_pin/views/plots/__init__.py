"""Figures: the workspace and the friction law of the paper, results, analyses and experiments.

Every function returns a matplotlib ``Figure`` that belongs to no window: save it with ``figure.savefig(path)``.
Figures of a result are drawn from its Dataset alone. ``__init__.pyi`` is the list.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
