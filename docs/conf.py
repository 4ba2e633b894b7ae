"""How the documentation is built: `make docs`.

Pages ask no other host for anything, maths included.
"""

import importlib.metadata
import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_ext"))
os.environ["MPLBACKEND"] = "Agg"

project = "stickslip"
author = "The stickslip developers"
copyright = f"2026, {author}"
release = version = importlib.metadata.version("stickslip")

EXAMPLES = ROOT / "examples"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx.ext.mathjax",
    "house",
    "pictures",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
    "_build",
    "_ext",
    "gallery/**/*.py",
    "gallery/**/*.ipynb",
    "**/GALLERY_HEADER.rst",
]

# ---------------------------------------------------------------- text

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
default_role = "obj"  # `name` in a docstring links where there is such a name

napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name
    for name in (
        "ArrayLike",
        "Array",
        "ComplexArray",
        "Distribution",
        "DelayModel",
        "Rig",
    )
}
autodoc_default_options = {"members": True}
maximum_signature_line_length = 80
add_module_names = False

# ------------------------------------ maths: MathJax from a wheel, one file, no network

mathjax_path = "mathjax.js"  # `house` puts it into _static
mathjax3_config = {
    "options": {"enableMenu": False},  # the menu would ask another host for more
    "tex": {"tags": "none"},
    "svg": {"fontCache": "global"},
}

# ---------------------------------------------------------------- pages

html_theme = "furo"
html_title = f"stickslip {version}"
html_static_path = ["_static"]
html_css_files = ["house.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0b5c8a",
        "color-brand-content": "#0b5c8a",
    },
    "dark_css_variables": {
        "color-brand-primary": "#6cb8e6",
        "color-brand-content": "#6cb8e6",
    },
}
pygments_style = "friendly"
pygments_dark_style = "monokai"

# ---------------------------------------------------------------- the gallery

sphinx_gallery_conf = {
    "examples_dirs": [str(EXAMPLES)],
    "gallery_dirs": ["gallery"],
    "subsection_order": [
        "../examples/practice",
        "../examples/elastic",
        "../examples/figures",
    ],
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("house.keep_figure",),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "write_computation_times": False,  # its pages ask other hosts for scripts
}
