"""Numbers, comments and text of XML, for all writers of it."""

from __future__ import annotations

import re
from xml.etree import ElementTree

Element = ElementTree.Element


def text(*numbers: float) -> str:
    """Text of numbers that is read back as the same floats."""
    return ' '.join(repr(float(x)) for x in numbers)


def comment(parent: Element, *sentences: str) -> None:
    """Sentences as comments, which may not contain two hyphens in a row."""
    for sentence in sentences:
        parent.append(ElementTree.Comment(f' {re.sub("-+", "-", sentence)} '))


def written(root: Element) -> str:
    """The text of a file, indented."""
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'
