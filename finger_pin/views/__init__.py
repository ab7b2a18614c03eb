"""Views of results and analyses: figures (`plots`), the viewer, the summary. It only reads."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
