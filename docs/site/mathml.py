"""Formulas as MathML, which browsers set by themselves: no script, no network."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

SIZES = re.compile(r'\\[bB]igg?[lrm]?(?![a-zA-Z])')  # of brackets; the converter knows none
HALF = re.compile(r'(\\[dt]?frac)\s*(\d)\s*(\d)')  # two arguments in TeX; here, one number
FUNCTION = re.compile(r'(<mo>&ApplyFunction;</mo>)(?!\s*<mo[^>]*>\()')
BEFORE = re.compile(
    r'(</m(?:i|n|sub|sup|subsup|over|row|frac)>|<mo[^>]*>\)</mo>)'
    r'(?=\s*<mi>\w{2,}</mi>\s*<mo>&ApplyFunction;)'
)
THIN_SPACE = r'\1<mspace width="0.1667em"></mspace>'  # browsers leave none around sin
LEAF = r'<(m\w+)[^>]*>[^<]*</\w+>'
ACCENTED = re.compile(
    rf'<munderover>\s*(?P<base>{LEAF})\s*(?P<index>(?:(?!<munderover>).)*?)\s*'
    r'(?P<accent><mo[^>]*>[˙¨ˆ^¯~→]</mo>)\s*</munderover>',
    re.DOTALL,
)
"""The converter sets an index of a letter with an accent below the letter."""
INDEXED = r'<msub><mover accent="true">\g<base>\g<accent></mover>\g<index></msub>'
POWER = re.compile(
    r'<msup>\s*<msub>(<mover accent="true">.*?</mover>)((?:(?!</?msub>).)*)</msub>'
    r'\s*(<m\w+[^>]*>[^<]*</m\w+>)\s*</msup>'
)
TIGHT = re.compile(r'<mo stretchy="false">([|/])</mo>')
logger = logging.getLogger(__name__)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer('mathml', (_inline, None), (_block, None))
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_converted(node, as_block=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="math">{_converted(node, as_block=True)}</div>')
    raise nodes.SkipNode


def _converted(node: nodes.Element, as_block: bool) -> str:
    text = SIZES.sub('', node.astext()).replace('°', r'^\circ ')
    text = HALF.sub(r'\1{\2}{\3}', text)
    try:
        made = FUNCTION.sub(THIN_SPACE, tex2mathml(text, as_block=as_block))
        made = ACCENTED.sub(INDEXED, BEFORE.sub(THIN_SPACE, made))
        made = POWER.sub(r'<msubsup>\1\2\3</msubsup>', made)
        return TIGHT.sub(r'<mo stretchy="false" lspace="0" rspace="0">\1</mo>', made)
    except MathError as error:
        logger.warning('%s in the formula %s', error, text, location=node)
        return ''
