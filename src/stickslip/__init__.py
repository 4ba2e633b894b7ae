"""Friction of interfaces made of many contacts: stick-slip or smooth sliding, and what
decides between them.

The public names import what they need on first use; `__init__.pyi` lists their modules.
Examples assume ``import stickslip as ss``, and numpy and xarray as ``np`` and ``xr``.
"""

import sys
from importlib.metadata import version

import lazy_loader

if sys.platform == "win32":
    raise ImportError(
        "stickslip needs the file locks and signals of Linux or macOS; under Windows, "
        "use WSL"
    )

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = version("stickslip")
