"""Machines of the site in motion: every picture of a scene plays, and opens the report of its run.

Runs are made when the site is built, and kept in build/runs by what they are made of: the scene
and the program. A run that has been made is not made again.
"""

from __future__ import annotations

import hashlib
import posixpath
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from docutils import nodes
from docutils.parsers.rst import Directive, directives
from plotly.offline import get_plotlyjs

import mechanism_sim as ms
from mechanism_sim import strict_json
from mechanism_sim.analysis.record import Record
from mechanism_sim.catalogue import scene_names
from mechanism_sim.export.skeleton import bounds
from mechanism_sim.export.stage import Swaying
from mechanism_sim.messages.events import describe
from mechanism_sim.pages import report
from mechanism_sim.pages.assets import import_map, styles
from mechanism_sim.pages.charts import sections
from mechanism_sim.pages.recorded import Recorded, recorded, times_of
from mechanism_sim.results.cycle import is_steady

ROOT = Path(__file__).parents[2]
KEPT = ROOT / 'build' / 'runs'
PICTURES = 'docs/pictures/mechanisms/'
BACK = '../docs/mechanisms.html'
LIBRARY = 'plotly.min.js'
MODULES = 'svg', 'stage', 'player'
TURNS = 3
"""Number of turns of a machine with clearance, and largest number on a card."""
MOST = 480
"""Number of instants on a card."""


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive('explore', Explore)
    app.connect('doctree-resolved', _link)
    app.connect('html-page-context', _enliven)
    app.connect('build-finished', _bake)
    return {'parallel_read_safe': True, 'parallel_write_safe': False}


class Explore(Directive):
    """A machine with a slider: a scene, and as content the arguments of `ms.explore`."""

    required_arguments = 1
    has_content = True
    option_spec = {'height': directives.positive_int}  # noqa: RUF012 - of docutils

    def run(self) -> list[nodes.Node]:
        """Insert a frame with the page."""
        given = yaml.safe_load('\n'.join(self.content))
        (scene,) = self.arguments
        key = key_of(describe(ms.load_scene(scene)), strict_json.dumps(given))
        page = kept(key, 'html', lambda: ms.explore(scene, **given).page)
        env = self.state.document.settings.env
        known = env.metadata.setdefault(env.docname, {})
        known['explored'] = ' '.join([*known.get('explored', '').split(), page.name])
        address = beside(env.docname, page.name)
        return [nodes.raw('', (
            f'<iframe class="explore" title="{scene} with a slider" src="{address}" '
            f'loading="lazy" style="height: {self.options.get("height", 740)}px"></iframe>'
        ), format='html')]  # fmt: skip


def beside(page: str, name: str) -> str:
    """Relative address of a run from a page."""
    return posixpath.relpath(f'runs/{name}', posixpath.dirname(page))


def _link(app: Any, tree: nodes.document, page: str) -> None:
    """Make a link to the run of each picture of a scene."""
    if app.builder.format != 'html':
        return
    for image in list(tree.findall(nodes.image)):
        folder, name = posixpath.split(image['uri'])
        if f'{folder}/' != PICTURES:
            continue
        address = beside(page, f'{name.removesuffix(".svg")}.html')
        link = nodes.reference('', '', refuri=address, classes=['plays'])
        image.replace_self(link)
        link += image


def _enliven(
    _app: Any, _page: str, _template: str, context: dict[str, Any], tree: nodes.document | None
) -> None:
    """Add the scripts for moving pictures to a page."""
    if tree is None or 'class="plays' not in context['body'].replace('reference external ', ''):
        return
    context['body'] = (
        f'<style>{styles("stage")}</style>{context["body"]}'
        f'<script type="importmap">{_modules()}</script>'
        '<script type="module">import "gallery";</script>'
    )


def _modules() -> str:
    """JavaScript modules of the pages, and that of the site."""
    own = Path(__file__).parent / 'gallery.js'
    return import_map(MODULES, {'gallery': own.read_text(encoding='utf-8')})


def _bake(app: Any, failed: Exception | None) -> None:
    """Write the runs of all scenes, and the pages with sliders."""
    if failed or app.builder.format != 'html':
        return
    folder = Path(app.outdir) / 'runs'
    folder.mkdir(exist_ok=True)
    (folder / LIBRARY).write_text(get_plotlyjs(), encoding='utf-8')
    for known in app.env.metadata.values():
        for name in known.get('explored', '').split():
            shutil.copy(KEPT / name, folder / name)
    for scene in scene_names():
        machine = ms.load_scene(scene)
        key = key_of(describe(machine))
        made: list[Recorded] = []

        def run(machine: Any = machine, made: list[Recorded] = made) -> Recorded:
            if not made:
                again = is_steady(machine) and bool(machine.plan.clearances)
                solution = ms.simulate(machine, revolutions=TURNS if again else None)
                made.append(recorded(Record(machine, solution, {})))
            return made[0]

        page = kept(key, 'html', lambda run=run: report.page(
            run(), sections(run().record), library=LIBRARY, back=BACK
        ))  # fmt: skip
        card = kept(key, 'js', lambda run=run, scene=scene: (
            f'moves({strict_json.dumps(scene)}, {strict_json.dumps(moving(run()))});\n'
        ))  # fmt: skip
        shutil.copy(page, folder / f'{scene}.html')
        shutil.copy(card, folder / f'{scene}.js')


def moving(run: Recorded) -> dict[str, Any]:
    """Data of a run for a card: shapes and their poses in the first turns."""
    record, turn = run.record, report.turn(run)
    end = min(record.end, record.start + (TURNS + 1e-9) * turn) if turn else record.end
    some = record.between(record.start, end) if end < record.end else record
    t = times_of(some, MOST)
    view, sway = some.piece.view(t), Swaying(some.machine).take(some.history)(t)
    frames = run.stage.frames(t, view.observed, view.modes, sway)
    none = np.zeros((len(t), 0, 2))
    frames = replace(
        frames, pins=none, pin_rates=none, walls=none, forces=none, feet=none,
        modes=frames.modes[:, :0], off=none, touching=frames.touching[:, :0],
    )  # fmt: skip
    stage = run.stage.to_json() | {'joints': [], 'bearings': [], 'plays': [], 'force': 0.0}
    stage['bounds'] = np.ravel(bounds(run.stage.skeleton, frames.poses)).tolist()
    return {'stage': stage, 'frames': frames.packed(), 'turn': turn}


def key_of(*parts: str) -> str:
    """Hash of the inputs of a run."""
    digest = hashlib.sha256('\0'.join(parts).encode())
    digest.update(_program())
    return digest.hexdigest()[:24]


@cache
def _program() -> bytes:
    """The program that makes the runs."""
    digest = hashlib.sha256(version('plotly').encode())
    for file in sorted([*_sources(), Path(__file__)]):
        digest.update(file.read_bytes())
    return digest.digest()


def _sources() -> Iterator[Path]:
    for kind in ('py', 'js', 'css', 'jinja'):
        yield from (ROOT / 'mechanism_sim').rglob(f'*.{kind}')


def kept(key: str, kind: str, make: Callable[[], str]) -> Path:
    """Path of a file, made if missing."""
    file = KEPT / f'{key}.{kind}'
    if not file.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        file.write_text(make(), encoding='utf-8')
    return file
