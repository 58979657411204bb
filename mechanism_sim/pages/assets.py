"""The files that pages are made of: styles, modules of JavaScript, templates."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from mechanism_sim import strict_json
from mechanism_sim.export.palette import css

_IMPORTED = re.compile(r"^import .* from '(\w+)';", re.MULTILINE)


def asset(name: str, room: str = __package__) -> str:
    """The text of a file in the `assets` of a room; of those of `pages` where it has none."""
    own, shared = (files(x).joinpath('assets', name) for x in (room, __package__))
    return (own if own.is_file() else shared).read_text(encoding='utf-8')


def styles(*names: str, room: str = __package__) -> Markup:
    """The palette and the contents of style files, for an element of a page."""
    return Markup(css() + ''.join(asset(f'{name}.css', room) for name in names))  # noqa: S704 - ours


def import_map(names: Iterable[str], more: Mapping[str, str] | None = None) -> str:
    """An import map that holds the modules themselves, for a page that is a single file.

    `more` are texts of modules that are not of the package, by name.

    Modules import each other by bare names, for a page without an address of its own has nothing
    that a relative one could start from.
    """
    texts = {name: asset(f'{name}.js') for name in names} | dict(more or {})
    addresses = {}
    for name, text in texts.items():
        if missing := {*_IMPORTED.findall(text)} - texts.keys():
            raise KeyError(f'{name}.js imports {", ".join(missing)}, which is not in the map')
        encoded = base64.b64encode(text.encode()).decode('ascii')
        addresses[name] = f'data:text/javascript;base64,{encoded}'
    return json.dumps({'imports': addresses})


def render(template: str, room: str = __package__, **values: Any) -> str:
    """A page from its template; what is no `Markup` is escaped."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset(template, room)).render(**values)


def contents_of(
    name: str, modules: Iterable[str], room: str = __package__, **values: Any
) -> dict[str, tuple[str, str]]:
    """Kind and text of what a server shows, by path: a page with its own styles, and modules."""
    page = render(
        f'{name}.html.jinja',
        room,
        style=styles('stage', 'style', name, room=room),
        imports=embedded({module: f'/{module}.js' for module in modules}),
        **values,
    )
    scripts = {f'/{x}.js': ('text/javascript', asset(f'{x}.js', room)) for x in modules}
    return {'/': ('text/html', page), **scripts}


def embedded(data: Any) -> Markup:
    """JSON for a page: nothing in it ends the element around it."""
    text = data if isinstance(data, str) else strict_json.dumps(data)
    return Markup(text.replace('<', '\\u003c'))  # noqa: S704 - escaped as JSON may be
