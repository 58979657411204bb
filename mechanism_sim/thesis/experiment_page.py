"""A page whose tables of the thesis's experiment are made by the command.

A table stands between ``<!-- experiment: NAME -->`` and ``<!-- /experiment -->``. NAME is that of
a table, or ``summary``.
"""

from __future__ import annotations

import re
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.thesis.experiment import Experiment
from mechanism_sim.thesis.experiment_tables import summary, tables

_MARKED = re.compile(
    r'^(?P<begin><!-- experiment: (?P<name>[^\n]+?) -->\n).*?^(?P<end><!-- /experiment -->)$',
    re.M | re.S,
)


def read_page(option: str, path: str) -> tuple[Path, str]:
    """A page with marks, and that it can be written."""
    file = output.check_path(option, path, '.md')
    try:
        text = file.read_text(encoding='utf-8')
    except (OSError, UnicodeError) as error:
        raise InputError(f"{option} '{path}' cannot be read: {error}") from error
    if not _MARKED.search(text):
        raise InputError(
            f"{option} '{path}' has no place for a table: write lines '<!-- experiment: bearings "
            "-->' and '<!-- /experiment -->' where it shall stand"
        )
    return file, text


def renewed(text: str, found: Experiment) -> str:
    """The text of a page with its tables made anew."""
    parts = {'summary': summary(found), **{t.name: t.markdown() for t in tables(found)}}

    def made(mark: re.Match[str]) -> str:
        name = mark['name']
        if name not in parts:
            raise InputError(
                f"the page asks for '{name}', a table that these runs do not give"
                f'{nearest(name, parts)}; they give: {", ".join(parts)}'
            )
        return f'{mark["begin"]}\n{parts[name]}\n\n{mark["end"]}'

    return _MARKED.sub(made, text)
