"""Formulas as MathML, which browsers draw without a script."""

import re
from typing import Any

from docutils import nodes
from math_core import LatexToMathML
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_LATEX = LatexToMathML()


def _mathml(node: nodes.Element, displayed: bool) -> str:
    formula = _LATEX.convert_with_local_state(node.astext(), displaystyle=displayed)
    # Fonts draw a prime at its height, and an exponent would raise it once more.
    primed = r"((?:<(m[in])>[^<]*</\2>)+)(<mo>[′″‴]</mo>)"
    formula = re.sub(rf"<msup>{primed}</msup>", r"\1\3", formula)
    return re.sub(rf"<msubsup>{primed}</msubsup>", r"<msub>\1</msub>\3", formula)


def _inline(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(f'<span class="math">{_mathml(node, displayed=False)}</span>')
    raise nodes.SkipNode


def _block(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_mathml(node, displayed=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the renderer `mathml`. An unknown command of LaTeX ends the build."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
