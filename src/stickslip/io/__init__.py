"""Reading and writing of rig files, Datasets and their provenance.

The public names, listed in `__init__.pyi`, import what they need on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
