"""Sphinx configuration."""

from importlib.metadata import version as installed_version

project = "deadtime"
author = "The deadtime developers"
release = installed_version("deadtime")
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
]
myst_enable_extensions = ["dollarmath", "amsmath"]
autodoc_default_options = {
    "inherited-members": "object,tuple,int,Exception",
    "special-members": "__call__",
}
autodoc_member_order = "groupwise"
autodoc_typehints = "none"
numpydoc_show_class_members = False
exclude_patterns = ["_build", "paper/reproduction-numbers.md"]
html_theme = "alabaster"
html_title = "deadtime"
