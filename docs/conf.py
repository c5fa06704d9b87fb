"""Sphinx configuration."""

import sys
import tempfile
from importlib.metadata import version as installed_version
from pathlib import Path

import deadtime as dtm

sys.path.insert(0, str(Path(__file__).parent))

project = "deadtime"
author = "The deadtime developers"
release = installed_version("deadtime")
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "entries",
    "folded_tests",
    "formulas",
    "names",
    "used_in",
]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
autodoc_default_options = {"special-members": "__call__"}
autodoc_member_order = "groupwise"
autodoc_typehints = "none"
autosummary_generate = False
# In docstrings `name` is a link where there is an entry of that name.
default_role = "py:obj"
numpydoc_show_class_members = False
# Types of arguments link to the classes that `names` gives.
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
exclude_patterns = ["_build", "paper/reproduction-numbers.md"]
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"deadtime {release}"
html_logo = html_favicon = "styles/mark.svg"
html_show_copyright = False
html_static_path = ["styles"]
html_css_files = ["pages.css"]
html_js_files = ["pages.js"]
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5f9e", "color-brand-content": "#0b5f9e"},
    "dark_css_variables": {"color-brand-primary": "#7cc0f5", "color-brand-content": "#7cc0f5"},
}
# What a reader copies is what a console takes.
copybutton_prompt_text = ">>> "

# The examples are run by the build, which ends at the first that fails.
_SECTIONS = "problems roots maps loops design estimation vehicles delay_equations paper"
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "examples",
    "subsection_order": [f"../examples/{section}" for section in _SECTIONS.split()],
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "copyfile_regex": r".*\.csv",
    "capture_repr": (),
    "download_all_examples": False,
    "image_srcset": ["2x"],
    "min_reported_time": 3600,
    "nested_sections": False,
    "show_signature": False,
    "write_computation_times": False,
    # Entries of the reference show the examples that use them.
    "backreferences_dir": "examples/backreferences",
    "doc_module": ("deadtime",),
}

# The explorer of the first page.
_explorer = tempfile.mkdtemp(prefix="deadtime-docs-")
dtm.ControlLoop(dtm.Integrator(), dtm.PV(Kp=1.5, Kv=0.13), delay=0.36, limit=1.0).explore(
    {"Kp": (0.0, 6.0), "Kv": (-1.0, 1.0)}
).save(f"{_explorer}/explorer.html")
html_extra_path = [_explorer]


def _level_of_captions(app, page, template, context, tree):
    """The captions of the list of pages are headings, to a screen reader of the second level."""
    shown = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = shown.replace(
        'role="heading"', 'role="heading" aria-level="2"'
    )


def setup(app):
    """Change the list of pages when the theme has made it."""
    app.connect("html-page-context", _level_of_captions, priority=900)
