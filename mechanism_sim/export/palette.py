"""Colours of links, of joints and of quantities: the same in pictures, on pages, in viewers.

The palette is safe for every kind of colour vision: whichever two of its colours, the distance
CIEDE2000 between them is at least 18, also as deuteranopes, protanopes and tritanopes see them
(G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, "A physiologically-based model for simulation
of color vision deficiency", IEEE TVCG 15(6), 2009), and all have a contrast of 3 or more on paper.
"""

from __future__ import annotations

from mechanism_sim.planar.mechanism import Mechanism

LINKS = (
    '#1a3fe0', '#ad8c07', '#009e97', '#d02c69', '#977dff', '#525700', '#1d372a', '#570f56',
)  # fmt: skip
"""Colours of the moving links, in their order, and of lines in charts; repeated from there."""

DARK = (
    '#b4b7ff', '#ffee96', '#8cffec', '#f08a9c', '#8861ff', '#98a600', '#447f53', '#936685',
)  # fmt: skip
"""Colours of links on dark ground."""

INK, PAPER, GROUND, ACCENT = '#1f2933', '#ffffff', '#66727f', '#c4342d'
"""Colours of edges, of what is seen through, of the frame, of drives and forces."""

IMPACT = '#b35900'
"""Colour of the marks of impacts."""

_TINT = 0.30  # share of a link's colour in its body; the rest is paper


def index(number: int) -> int:
    """Index of the colour of a link or line by its number; -1 for the frame."""
    return -1 if number < 0 else number % len(LINKS)


def colour(number: int) -> str:
    """Colour of a link or line by its number; negative for the frame."""
    return GROUND if number < 0 else LINKS[index(number)]


def css() -> str:
    """The palette as custom properties of a page: ``--link--1`` of the frame, ``--link-0`` ..."""
    light, dark = (
        ' '.join(f'--link-{k - 1}: {shade};' for k, shade in enumerate([ground, *shades]))
        for ground, shades in ((GROUND, LINKS), ('#9aa5b1', DARK))
    )
    return (
        f':root {{ {light} }}\n'
        '@media screen and (prefers-color-scheme: dark) '
        f'{{ body:is(.report, .edit, .live) {{ {dark} }} }}\n'
    )


def numbers(mechanism: Mechanism) -> dict[str, int]:
    """Numbers of joints and moving links by name, which select their colours."""
    joints = {joint.name: k for k, joint in enumerate(mechanism.joints)}
    return joints | {body.name: k for k, body in enumerate(mechanism.bodies)}


def tint(shade: str, part: float = _TINT) -> str:
    """A colour mixed with that of paper."""
    mixed = (part * a + (1.0 - part) * b for a, b in zip(rgb(shade), rgb(PAPER), strict=True))
    return '#' + ''.join(f'{round(255 * x):02x}' for x in mixed)


def rgb(shade: str) -> tuple[float, float, float]:
    """Red, green and blue, 0 to 1 each."""
    r, g, b = (int(shade[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return r, g, b
