"""The documentation site: `.ci/docs` builds it; what code can say is written at build time by `generated.py`."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import generated  # noqa: E402

import femimpact  # noqa: E402

project = "femimpact"
author = "femimpact developers"
copyright = "2026, the femimpact developers"
release = version = femimpact.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinxcontrib.bibtex",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    "_build",
    "_templates",
    "api/examples",
    "README.md",
    "gallery/*.ipynb",
    "gallery/*.py",
]
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = "femimpact"
html_theme = "pydata_sphinx_theme"
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 9,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": [], "start": [], "development/contributing": [], "development/changelog": []}

# pages are Markdown; a heading is an anchor, and links between pages are checked
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["config.cache"]

# names without a module are those of femimpact; what cannot be found stays as it is written
default_role = "py:obj"
add_module_names = False
autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

# one file of MathJax lies in the site: nothing is fetched when a page is read
MATHJAX = Path(find_spec("sphinx-mathjax-offline").origin).parent / "static" / "mathjax"
mathjax_path = "tex-svg-full.js"
html_static_path.append(str(MATHJAX / "tex-svg-full.js"))

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "doc_module": ("femimpact",),
    "reference_url": {"femimpact": None},
    "backreferences_dir": "api/examples",
    "inspect_global_variables": False,
    "within_subsection_order": "generated.BySubject",
    "reset_modules": ("matplotlib", "generated.script_path"),
    "reset_modules_order": "before",
    "nested_sections": False,
    "abort_on_example_error": True,
    "matplotlib_animations": False,
    "default_thumb_file": str(HERE / "pictures" / "overview.png"),
    "capture_repr": (),
    "image_scrapers": ("generated.scrape",),
    # the environment says whether examples run; without them the gallery has their text and code
    "plot_gallery": os.environ.get("FEMIMPACT_GALLERY", "1") == "1",
}


def setup(app):
    """Pages that code writes, and the words of docstrings as they are meant."""
    generated.write(HERE / "api")
    app.connect("builder-inited", generated.draw_thumbnails, priority=900)
    app.connect("autodoc-process-docstring", generated.plain_docstring)
    app.connect("source-read", generated.site_page)
