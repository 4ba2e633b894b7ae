"""Rig files, Datasets and their provenance: what goes to files and comes back.

The public names load what they need on first use; `__init__.pyi` beside this file has
them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
