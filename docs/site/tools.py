"""The tools of the editor, from its palette, in the page of the editor."""

from __future__ import annotations

from typing import Any

from mechanism_sim.editor.palette import GROUPS

PAGE, MARK = 'docs/editing', '<!-- tools -->\n'


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: the table takes the place of its mark."""
    app.connect('source-read', _insert)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _insert(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] = source[0].replace(MARK, table())


def table() -> str:
    """All tools as a table of Markdown."""
    rows = [f'| {t.name} | {t.key} | {t.hint} |' for tools in GROUPS.values() for t in tools]
    return '\n'.join(['| tool | key | |', '|---|---|---|', *rows, ''])
