"""CHANGELOG.rst, which tools of ROS read: ``python docs/changelog.py`` makes it of CHANGELOG.md.

It holds the versions that are released, in the form of REP 132; part of making a release.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
TITLE = 'Changelog for package mechanism_sim'


def to_rst(markdown: str) -> str:
    """The released versions of a changelog in Markdown, as reStructuredText."""
    lines = ['^' * len(TITLE), TITLE, '^' * len(TITLE), '']
    for part in re.split(r'^## ', markdown, flags=re.MULTILINE)[1:]:
        head, _, body = part.partition('\n')
        if not (named := re.fullmatch(r'\[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)', head)):
            continue  # not released yet
        title = '{} ({})'.format(*named.groups())
        lines += [title, '-' * len(title)]
        for section in re.split(r'^### ', body, flags=re.MULTILINE)[1:]:
            # A section may have groups, each below a line in bold: `* New, Python: ...`.
            kind, *groups = re.split(r'^\*\*(.+)\*\*$', section, flags=re.MULTILINE)
            kind, _, ungrouped = kind.partition('\n')
            for group, listed in zip(['', *groups[::2]], [ungrouped, *groups[1::2]], strict=True):
                label = f'{kind}, {_inline(group)}' if group else kind
                items = re.split(r'(?:^|\n+)- ', listed.strip())[1:]
                lines += [f'* {label}: {_inline(item)}' for item in items]
        lines.append('')
    return '\n'.join(lines)


def _inline(text: str) -> str:
    """Code and links as reStructuredText; links to files of the repository as text."""
    text = re.sub(r'`+', '``', text)
    text = re.sub(r'\[([^]]+)\]\((https?://[^)]+)\)', r'`\1 <\2>`__', text)
    return re.sub(r'\[([^]]+)\]\([^)]+\)', r'\1', text)


if __name__ == '__main__':
    text = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    (ROOT / 'CHANGELOG.rst').write_text(to_rst(text), encoding='utf-8')
