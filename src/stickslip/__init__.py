"""Friction of interfaces made of many contacts: stick-slip or smooth sliding, and what decides between them.

The public names load what they need on first use; `__init__.pyi` beside this file says where each one lives.
"""

from importlib.metadata import version

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = version("stickslip")
