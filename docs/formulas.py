"""Formulas as MathML, which browsers draw without a script."""

from typing import Any

from docutils import nodes
from math_core import LatexToMathML
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_LATEX = LatexToMathML()


def _inline(writer: HTML5Translator, node: nodes.math) -> None:
    formula = _LATEX.convert_with_local_state(node.astext(), displaystyle=False)
    writer.body.append(f'<span class="math">{formula}</span>')
    raise nodes.SkipNode


def _block(writer: HTML5Translator, node: nodes.math_block) -> None:
    formula = _LATEX.convert_with_local_state(node.astext(), displaystyle=True)
    writer.body.append(f'<div class="math">{formula}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the renderer `mathml`. An unknown command of LaTeX ends the build."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
