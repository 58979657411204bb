"""Session of a document: requests of its pages, and messages to them."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mechanism_sim import documents
from mechanism_sim.arrays import Array
from mechanism_sim.catalogue import scene_names
from mechanism_sim.editor import gestures, palette, panel, turn_chart, wear
from mechanism_sim.editor.assembly_choices import as_drawn, choices
from mechanism_sim.editor.background import Job
from mechanism_sim.editor.beside import BesideDocument
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.force_arrows import ForceArrows
from mechanism_sim.editor.layout import coordinates, placed
from mechanism_sim.editor.picture import DocumentPicture, has_path, nothing, pictured
from mechanism_sim.editor.rounding import unit_of
from mechanism_sim.editor.sketch import (
    GONE,
    Edit,
    Grid,
    Sketch,
    Spot,
    drives_of,
)
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.keys.names import check_link_name
from mechanism_sim.packages import reason
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene import Machine

Send = Callable[[dict[str, Any]], None]
Chosen = tuple[tuple[str, ...], dict[str, bool]]
"""The path of the part whose keys are listed; points whose paths somebody wants drawn, or not."""

FARTHEST = 1e4
"""[m] Half the size of the sheet."""

_SAID = 1000  # longest sentence [characters]; names may be long

_MOST_PARTS = 160  # links and joints of what is drawn: more takes minutes to compile


class Session:
    """Session of a document, with its picture and the handle that is dragged.

    Parameters
    ----------
    send : callback that sends a message to all pages
    number : number of the first state
    heavy : reason by text that is not drawn because it is too large
    chosen : choices of the previous session of the document
    """

    def __init__(
        self,
        document: Document,
        send: Send,
        number: int = 0,
        heavy: Mapping[str, str] | None = None,
        chosen: Chosen | None = None,
    ) -> None:
        self.document, self._send = document, send
        self.number = number  #: number of the document's state
        self._heavy = dict(heavy or {})
        self._path, self._traced = chosen or ((), {})
        self._picture = nothing(Document().scene())
        self._beside = BesideDocument()
        self._grabbed: tuple[str, DocumentPicture] | None = None
        self._of: str | None = None  # text of the picture
        self._tried: list[Edit] = []  # edits of the present drag
        self._arrows, self._forces_of = ForceArrows(), 0  # state number of the forces shown
        self._pulled: Array | None = None  # coordinates of a machine that is moved by hand
        self._found: dict[str, dict[str, Any]] = {}
        try:
            self._refresh()
            self._shown = self.state()
        except Exception as error:
            self._give_up(error)

    # --- requests ---------------------------------------------------------------------------

    def handle(self, message: Mapping[str, Any]) -> None:
        """Carry out a request of a page, and show the result or the reason of a refusal."""
        acts: dict[str, Callable[[Mapping[str, Any]], None]] = {
            'drag': self._drag, 'drop': self._drop, 'pull': self._pull, 'draw': self._draw,
            'set': self._set, 'remove': self._remove, 'rename': self._rename,
            'select': self._select, 'trace': self._trace,
            'chart': lambda m: self._beside.choose(str(m['quantity'])),
            'wear': lambda m: self._beside.wear(m, self._picture.scene),
            'save': self._save, 'open': self._open, 'import': self._open,
            'undo': lambda _: self.document.undo(), 'redo': lambda _: self.document.redo(),
            'text': lambda m: self.document.replace(str(m['text'])),
        }  # fmt: skip
        kind = str(message.get('type'))
        if kind not in acts:
            return
        try:
            if first := message.get('first'):  # text still being typed on saving
                acts[str(first['type'])](first)
            acts[kind](message)
        except (InputError, RunError) as error:
            self._say(str(error))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError):
            self._say('that is not a command of this page')
        except Exception as error:  # no message may end the session
            self._say(f'that is not possible ({reason(error)})')
        if kind not in ('drag', 'pull'):
            if self._grabbed:  # restored, unless dropped at an allowed position
                self._of = None
            self._grabbed, self._tried, self._pulled = None, [], None
            try:
                self._refresh()
                self._show()
            except Exception as error:
                self._give_up(error)
                self._send(self._shown)

    def _give_up(self, error: Exception) -> None:
        """Show an empty picture of a document that cannot be drawn."""
        self._heavy[self.document.text] = f'it cannot be drawn ({reason(error)})'
        self._of = None
        self._picture = nothing(Document().scene())
        self._refresh()
        self._shown = self.state()

    def state(self) -> dict[str, Any]:
        """Complete state of a page."""
        document, picture = self.document, self._picture
        try:
            content = document.content()
        except InputError:
            content = {}
        found = panel.rows(content, self._path) if content else []
        undo, redo = document.steps
        return {
            'type': 'state',
            'number': self.number,
            'name': document.name,
            'file': str(document.file or ''),
            'changed': document.changed,
            'undo': undo,
            'redo': redo,
            'text': document.text,
            'short': content.get('mechanism') == 'four_bar',
            'path': list(self._path),
            'rows': found,
            'outline': panel.outline(content) if content else [],
            'tracks': picture.tracks(self._path, self._traced),
            'problem': picture.problem,
            'hint': picture.hint,
            'wears': wear.joints(picture.scene),
            'length': str(content.get('duration', '')),
            'quantities': turn_chart.names(picture.turn),
            'chart': self._beside.chart(picture.turn),
            'place': [] if picture.hint else _place_of(picture.problem, content),
            **picture.to_json(
                document.name, self._traced, 0.0, self._beside.colours(picture.scene)
            ),
        }

    @property
    def chosen(self) -> Chosen:
        """Choices of the users: selected part and traced points."""
        return self._path, self._traced

    @property
    def greeting(self) -> list[dict[str, Any]]:
        """Messages for a page that has just been opened."""
        return [self._shown, *self._found.values()]

    def job(self) -> Job | None:
        """Document to be checked and run, as it is dragged; None if it is none."""
        try:
            content = self.document.whole(self._tried)
            scene, worn = self._picture.scene, None
            if edits := self._beside.worn(Sketch(scene, self._picture.poses, wear.GRID)):
                whole = self.document.whole([*self._written_out(), *self._tried, *edits])
                worn = whole, self._beside.pin
            return Job(self.number, self.document.name, content, worn)
        except InputError:
            return None

    def found(self, number: int, kind: str, data: Any) -> None:
        """Show a result of a job, if it is that of the present state."""
        if number != self.number:
            return
        if kind == 'problem' and not self._grabbed:
            self._picture = self._picture._replace(problem=data)
            self._show()
        message = {'type': kind, 'data': data, 'number': number}
        self._found[kind] = message
        self._send(message)

    def pause(self) -> None:
        """Show the forces of ideal joints, if not yet shown, while no request is pending."""
        if self._forces_of == self.number or self._grabbed:
            return
        self._forces_of = self.number
        symbol = self._shown['stage']['symbol']
        if data := self._arrows.of_turn(self._picture.turn, symbol):
            self._found['forces'] = {'type': 'forces', 'number': self.number, 'data': data}
            self._send(self._found['forces'])

    def _show(self) -> None:
        self._shown = self.state()
        self._send(self._shown)

    def _say(self, text: str) -> None:
        cut = text if len(text) <= _SAID else f'{text[: _SAID // 2]} ... {text[-_SAID // 4 :]}'
        self._send({'type': 'said', 'text': cut})

    # --- the picture ------------------------------------------------------------------------

    def _refresh(self) -> None:
        """Make the picture of the document anew."""
        text = self.document.text
        if self._of == text:
            return
        self.number += 1
        self._of = text
        self._found.clear()
        if text in self._heavy:
            self._picture = self._picture._replace(turn=None, problem=self._heavy[text])
            return
        try:
            scene = self.document.scene()
            parts = len(scene.links) + len(scene.joints)
            if parts > _MOST_PARTS:
                raise InputError(
                    f'{self.document.name}: its {parts} links and joints are not drawn, as that '
                    f'takes too long: allowed are {_MOST_PARTS}; check and solve take more'
                )
        except InputError as error:
            self._picture = self._picture._replace(problem=str(error))
            return
        old = self._picture._replace(
            poses={**self._picture.poses, **self._beside.lain.get(text, {})}
        )
        self._picture = pictured(self.document.name, scene, old)
        self._beside.lain[text] = self._picture.poses

    # --- gestures ---------------------------------------------------------------------------

    def _moved(self, message: Mapping[str, Any]) -> tuple[list[Edit], DocumentPicture]:
        """Document after a handle is moved, and its picture."""
        key, grid = str(message['handle']), _grid(message, self.document)
        if self._grabbed is None or self._grabbed[0] != key:
            self._grabbed = key, self._picture
        before = self._grabbed[1]
        to = _place(message)
        handle = before.handle(key)
        short = self.document.content().get('mechanism') == 'four_bar'
        edits, poses = gestures.move(before.scene, before.poses, handle, to, grid, short)
        scene, loops = self.document.scene(edits), None
        if not short and (more := gestures.fitting(scene, placed(scene, poses), grid)):
            edits = [*edits, *more]
            scene = self.document.scene(edits)
        made: Machine | None = (machine := Machine(self.document.name, scene))
        try:
            loops = machine.plan.kinematics(())
        except InputError:
            return edits, pictured(self.document.name, scene, self._picture, poses)
        tree = loops.mechanism
        driven = [c for c in drives_of(scene) if c in tree.coordinates]
        lies = coordinates(tree, poses)[:, None]
        q, left = loops.holding(driven).positions(lies)
        if left[0]:  # cannot be assembled at the positions of its drives
            q, left = loops.positions(lies)
        if not left[0]:
            found = dict(zip(tree.coordinates, q[:, 0].tolist(), strict=True))
            if more := gestures.starts(scene, found, tree.displacements, grid):
                edits, made = [*edits, *more], None
                scene = self.document.scene(edits)
        return edits, pictured(self.document.name, scene, self._picture, poses, loops, made)

    def _drag(self, message: Mapping[str, Any]) -> None:
        begun = time.thread_time()
        edits, self._picture = self._moved(message)
        if list(edits) != self._tried:
            self._tried = list(edits)
            self.number += 1
        problem, hint = self._picture.problem, self._picture.hint
        frame = {'type': 'frame', 'number': self.number, 'problem': problem, 'hint': hint}
        symbol = self._shown['stage']['symbol']
        colours = self._beside.colours(self._picture.scene)
        frame |= self._picture.to_json(self.document.name, self._traced, symbol, colours)
        chart = self._beside.chart(self._picture.turn)
        frame |= self._arrows.of_drag(self._picture.turn, begun) | {'chart': chart}
        self._send(frame)

    def _drop(self, message: Mapping[str, Any]) -> None:
        edits, picture = self._moved(message)
        self.document.change([*edits, *choices(self.document, edits, picture)])
        self._beside.lain[self.document.text] = picture.poses

    def _pull(self, message: Mapping[str, Any]) -> None:
        """Move the machine along its motion, so that a handle comes nearest to a target."""
        turn = self._picture.turn
        if turn is None or not turn.q.size:
            raise InputError('this is not a complete machine yet: it cannot be turned by hand')
        handle = self._picture.handle(message['handle'])
        link, name = next(((x, n) for x, n in handle.members if x != GROUND), ('', ''))
        if not link:
            return
        at = turn.machine.plan.points[link][name]
        links = [body.name for body in turn.mechanism.bodies]
        if not turn.moves:  # several degrees of freedom
            before = turn.q[:, 0] if self._pulled is None else self._pulled
            self._pulled = turn.reached(before, link, at, _place(message))
            k, poses = 0, turn.poses_of(self._pulled)
        else:
            x, y = turn.mechanism.locate_all(link, turn.q, at)
            to = _place(message)
            k = int(np.argmin(np.hypot(x - to[0], y - to[1])))
            poses = turn.poses_at(k)
        self._send({'type': 'pose', 'instant': k, 'poses': [poses[link] for link in links]})

    def _draw(self, message: Mapping[str, Any]) -> None:
        grid, what = _grid(message, self.document), str(message['what'])
        start, end = (
            _seen(spot, self._picture)
            if spot.get('number', self.number) == self.number
            else _near(spot, self._picture, float(message['near']))
            for spot in (message['from'], message['to'])
        )
        before, picture = self.document.text, self._picture
        sketch = Sketch(picture.scene, picture.poses, grid)
        edits = palette.draw(sketch, what, start, end)
        if written := self._written_out():
            try:
                self.document.scene(edits)
            except InputError:  # not possible in the short form
                edits = [*written, *edits]
        self.document.change([*edits, *as_drawn(self.document, edits, picture, sketch.poses)])
        if self.document.text != before and edits:
            self._beside.lain[self.document.text] = sketch.poses
            path = edits[0].path
            self._path = path[: 1 if path[0] == 'drive' else 2]

    # --- the panel --------------------------------------------------------------------------

    def _set(self, message: Mapping[str, Any]) -> None:
        path, text = _path(message), str(message['text'])
        if not text.strip():
            self.document.change([Edit(path, GONE)])
            return
        try:
            value = panel.typed(self.document.content(), path, text)
        except documents.DocumentError as error:
            raise InputError(f'{".".join(path)}:{error}') from error
        self.document.change([Edit(path, value)])

    def _remove(self, message: Mapping[str, Any]) -> None:
        path = _path(message)
        short = self._written_out() if path[0] in ('links', 'joints') and len(path) < 3 else []
        present = {*self.document.content(), *(edit.path[0] for edit in short)}
        edits = gestures.remove(self._picture.scene, self.document.content(), path)
        self.document.change([*short, *(edit for edit in edits if edit.path[0] in present)])
        if self._path[: len(path)] == path:
            self._path = ()

    def _rename(self, message: Mapping[str, Any]) -> None:
        path, name = _path(message), str(message['name']).strip()
        there: Any = self.document.content()
        for part in path[:-1]:
            there = there[part]
        if name == path[-1] or path[-1] not in there:
            return
        fixed = len(path) < 2 or GROUND in (name, path[-1])
        if not name.isidentifier() or name in there or fixed:
            raise InputError(
                f"'{name}' cannot be its name: use letters, digits and _, no name in use"
            )
        if path[0] == 'links' and len(path) == 2:
            check_link_name(name)
        short = self._written_out() if path[0] in ('links', 'joints') else []
        self.document.rename(path, name, short)
        if path[0] == 'links':
            self._beside.rename(path[-1], name, self._picture.poses, self.document.text)
        self._path = (*path[:-1], name)

    def _select(self, message: Mapping[str, Any]) -> None:
        self._path = _path(message)

    def _trace(self, message: Mapping[str, Any]) -> None:
        point = str(message['point'])
        self._traced[point] = not has_path(point, self._traced)

    # --- files ------------------------------------------------------------------------------

    def _save(self, message: Mapping[str, Any]) -> None:
        self._say(f'saved: {self.document.save(str(message.get("name") or ""))}')

    def _open(self, message: Mapping[str, Any]) -> None:
        name = str(message.get('name') or '')
        if 'text' in message:  # text of a file dropped on a page
            document = Document.dropped(name, str(message['text']))
        elif name and name not in scene_names():
            raise InputError(f"there is no scene '{name}' in the package")
        else:
            document = Document.open(name) if name else Document()
        document.watch, watch = self.document.watch, self.document.watch
        self.document = document
        watch('opened', document)
        self._path, self._traced, self._beside = (), {}, BesideDocument()
        self._picture = nothing(Document().scene())
        self._of = None

    def _written_out(self) -> list[Edit]:
        return gestures.written_out(self._picture.scene, self.document.content())


def _place(message: Mapping[str, Any]) -> tuple[float, float]:
    """Position on the sheet [m]."""
    x, y = float(message['x']), float(message['y'])
    if not max(abs(x), abs(y)) <= FARTHEST:
        raise InputError(f'that is too far away: the sheet ends {FARTHEST:g} m from its middle')
    return x, y


def _grid(message: Mapping[str, Any], document: Document) -> Grid:
    step = float(message['step'])
    if not 1e-9 < step < 1e3:
        raise InputError('that is too fine or too coarse')
    return Grid(step, unit_of(document.content().get('links')) or 'mm')


def _near(data: Mapping[str, Any], picture: DocumentPicture, near: float) -> Spot:
    """Spot of a page with an older picture, on the part at its position [m] in the new one."""
    at = _place(data)
    known = any(handle.key == data.get('handle') for handle in picture.handles)
    if not known and (handle := picture.caught(at, near)):
        data = {**data, 'handle': handle.key}
    return _seen({**data, 'link': data.get('link') or picture.met(at, 0.5 * near)}, picture)


def _seen(data: Mapping[str, Any], picture: DocumentPicture) -> Spot:
    handle = picture.handle(data['handle']) if data.get('handle') else None
    link = '' if handle else str(data.get('link') or '')
    link = link if link in picture.scene.links and link != GROUND else ''
    return Spot(_place(data), handle, link)


def _path(message: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(part) for part in message['path'])


def _place_of(problem: str, content: Mapping[str, Any]) -> list[str]:
    """Path of a scene found in a sentence; empty if there is none."""
    best: list[str] = []
    for word in re.findall(r'[A-Za-z_]\w*(?:\.\w+)*', problem):
        parts = word.split('.')
        if parts[0] not in content and parts[0] not in ('drive', 'duration', 'start'):
            continue
        if len(parts) > len(best) and (len(parts) > 1 or f"'{word}'" in problem):
            best = parts
    return best
