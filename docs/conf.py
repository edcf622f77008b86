"""Sphinx: the documentation of mbrs. `python docs/build.py` builds it."""

import sys
import warnings
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS / "_ext"), str(DOCS.parent / "tests")]
sys.path.append(str(DOCS.parent / "examples" / "literature"))

import mbrs  # noqa: E402

project = "mbrs"
author = "The mbrs authors"
copyright = "2026, the mbrs authors"
release = version = "0.1.0"

extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery", "sphinx_design", "sphinx_copybutton",
    "mathml", "reference", "manual_page", "outside", "running",
]  # fmt: skip
html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = "mbrs"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
}
exclude_patterns = [
    "_ext",
    "_static",
    "img",
    "build.py",
    "conf.py",
    "gallery/**/*.ipynb",
    "gallery/**/*.py",
    "gallery/**/*.zip",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = False
# numbers as measured: no thumbnails shrunk, no typographic quotes
smartquotes = False

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
# an equation keeps its \tag: docs/_ext/mathml.py reads it
myst_dmath_allow_labels = False

autodoc_typehints = "none"
autodoc_member_order = "groupwise"
# what results and objects of models need to print, to check and to save themselves
HELPERS = (
    "attributes, axes, blocks, check_together, columns, data_state, error_dims, fields, heading, labelled, labels_of, moved, notes, "
    "place_now, quantities, recheck, replaced, row, rows, table"
)
autodoc_default_options = {"exclude-members": HELPERS}
toc_object_entries_show_parents = "hide"
# `Model.body` in a docstring is a link where there is such a thing
default_role = "py:obj"
autodoc_class_signature = "mixed"
napoleon_numpy_docstring, napoleon_google_docstring = True, False
napoleon_use_ivar = True
napoleon_use_rtype = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": ["../examples/gallery"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"/plot_",
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "plot_gallery": True,
    "min_reported_time": 0,
    "write_computation_times": False,
    "abort_on_example_error": True,
    "matplotlib_animations": False,
    "nested_sections": False,
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib",),
    "thumbnail_size": (320, 224),
}
# a warning of mbrs in a script of the gallery or a block of a page ends the build
warnings.filterwarnings("error", category=mbrs.MbrsWarning)
# names of arguments that several classes have are not links
suppress_warnings = ["config.cache", "ref.python"]
assert mbrs.__doc__
