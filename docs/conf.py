"""The site: Markdown pages, the API from docstrings, the examples as a gallery, effects drawn by code."""

import importlib.util
import os
import shutil
import sys
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # pages.py, effect_pages.py

import api_pages  # noqa: E402
import effect_pages  # noqa: E402

import ctrl_df  # noqa: E402

project = "ctrl_df"
author = "The ctrl_df founders"
copyright = "the ctrl_df founders, MIT licence"
version = release = ctrl_df.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "gallery/*.ipynb", "gallery/*.py", "gallery/*.md5", "**/sg_execution_times.rst"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3

MATHJAX = Path(importlib.util.find_spec("sphinx-mathjax-offline").origin).parent / "static" / "mathjax"
mathjax_path = "mathjax/tex-chtml.js"  # served by the site itself: it is read without a network, too

autosummary_generate = True
autodoc_typehints = "none"  # docstrings state types
numpydoc_show_class_members = False
templates_path = ["_templates"]

html_theme = "pydata_sphinx_theme"
html_title = "ctrl_df"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_sidebars = {"index": [], "search": []}
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "show_prev_next": False,
    "footer_start": ["copyright"],
    "footer_end": [],
}

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/(?!_|emps|xl330|damper|cluster)[^/]*$",  # these ask for data, or for a cluster
    "ignore_pattern": r"/_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "image_scrapers": ("matplotlib",),
    "capture_repr": ("_repr_html_",),  # tables are shown, addresses of objects are not
    "default_thumb_file": str(HERE / "images" / "missing.png"),  # of examples that ask for data
    "abort_on_example_error": True,
    "plot_gallery": "True",
}


def copy_mathjax(app, error):
    """Put what formulas need beside the pages: the program and its fonts."""
    if error is None and app.builder.name == "html":
        target = Path(app.outdir) / "_static" / "mathjax"
        fonts = Path("output", "chtml", "fonts", "woff-v2")
        shutil.copytree(MATHJAX / fonts, target / fonts, dirs_exist_ok=True)
        shutil.copy(MATHJAX / "tex-chtml.js", target)


def setup(app):
    """Write the pages that are made by code, before anything is read."""
    api_pages.write(HERE / "api")
    effect_pages.write(HERE / "effects")
    app.connect("build-finished", copy_mathjax)
