"""Sphinx configuration."""

from importlib.metadata import version as installed_version

project = "deadtime"
author = "The deadtime developers"
release = installed_version("deadtime")
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
]
myst_enable_extensions = ["dollarmath", "amsmath"]
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
exclude_patterns = ["_build", "reproduction-numbers.md"]
html_theme = "alabaster"
html_title = "deadtime"
