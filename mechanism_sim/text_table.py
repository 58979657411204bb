"""Tables for people: lines of text whose columns stand below each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Cell = str | int | float


def lines(
    rows: Iterable[Sequence[Cell]], left: int | Sequence[int] = 1, indent: str = '  ',
    rule: bool = False,
) -> list[str]:  # fmt: skip
    """Lines of a table.

    Parameters
    ----------
    rows : the head first, if there is one; numbers get six digits
    left : number or indices of left-aligned columns; the others are right-aligned
    indent : before each line
    rule : True if a line of hyphens follows the first row
    """
    cells = [[f'{x:.6g}' if isinstance(x, float) else str(x) for x in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    ahead = range(left) if isinstance(left, int) else left
    if rule:
        cells.insert(1, ['-' * width for width in widths])
    sides = ['<' if i in ahead else '>' for i in range(len(widths))]
    aligned = (
        '  '.join(f'{x:{s}{w}}' for x, s, w in zip(row, sides, widths, strict=True))
        for row in cells
    )
    return [indent + line.rstrip() for line in aligned]
