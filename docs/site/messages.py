"""The reference of messages, generated from the files in msg/."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

PAGE = 'docs/messages'
FOLDER = Path(__file__).parents[2] / 'msg'
FIELD = re.compile(r'(?P<kind>[\w/\[\]]+)\s+(?P<name>[^#]*?)\s*(?:#\s*(?P<about>.*))?')


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: the tables are appended to their page."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += reference()


def reference() -> str:
    """All messages as Markdown, a section each."""
    return ''.join(_section(file) for file in sorted(FOLDER.glob('*.msg')))


def _section(file: Path) -> str:
    text = file.read_text(encoding='utf-8').splitlines()
    about = [line.lstrip('# ') for line in text if line.startswith('#')]
    lines = ['', f'## {file.stem}', '', ' '.join(about), '']
    lines += ['| field | type | meaning |', '|---|---|---|']
    for line in text:
        field = FIELD.fullmatch(line.strip())
        if field and not line.startswith('#'):
            meaning = (field['about'] or '').replace('|', '\\|').replace('<', '\\<')
            meaning = meaning.replace('[', '\\[').replace('*', '\\*')
            lines.append(f'| `{field["name"]}` | `{field["kind"]}` | {meaning} |')
    return '\n'.join([*lines, ''])
