"""A document under the hands of those who have its page open: what they ask for, what they see."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim import documents
from mechanism_sim.arrays import Array
from mechanism_sim.catalogue import scene_names
from mechanism_sim.editor import drawing, gestures, palette, panel
from mechanism_sim.editor.background import Job
from mechanism_sim.editor.document import Document
from mechanism_sim.editor.layout import coordinates, placed
from mechanism_sim.editor.motion import IdealForces, Turn
from mechanism_sim.editor.rounding import degrees, unit_of
from mechanism_sim.editor.sketch import (
    GONE,
    ORIGIN,
    Edit,
    Grid,
    Handle,
    Poses,
    Sketch,
    Spot,
    points_of,
)
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.packages import reason
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import Scene

Send = Callable[[dict[str, Any]], None]
Chosen = tuple[tuple[str, ...], dict[str, bool]]
"""The path of the part whose keys are listed; points whose paths somebody wants drawn, or not."""

_BUDGET = 0.012
"""[s] of a frame, of 17 ms; where forces take it beyond, they come with one frame in `_SOME`."""

_SOME = 4

_ARROW = 0.3
"""Length of the arrow of the largest force, of the machine's size."""

_FAR = 0.2
"""[rad], or sizes of the machine: more is another way to close the loops."""


FARTHEST = 1e4
"""[m] Half the size of the sheet."""

_SAID = 1000  # characters of a sentence; somebody may have given a name of thousands

MOST_PARTS = 160
"""Links and joints of what is drawn: more takes minutes to compile."""


class SessionPicture(NamedTuple):
    """Picture, panel and results of a document.

    Attributes
    ----------
    turn : of the machine, if it can be assembled
    poses : of all links
    problem : why it is no machine yet; empty if it is one
    """

    scene: Scene
    turn: Turn | None
    poses: Poses
    problem: str


class Session:
    """A document, its picture, and what is grabbed of it.

    Parameters
    ----------
    send : to all pages
    number : of the first state
    heavy : why texts are not drawn, for those that are too much
    chosen : as of another session of the document that this one follows

    Attributes
    ----------
    number : counts the states of the document
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
        self.number, self._heavy = number, dict(heavy or {})
        self._path, self._traced = chosen or ((), {})
        self._picture = SessionPicture(Document().scene(), None, {GROUND: ORIGIN}, '')
        self._grabbed: tuple[str, SessionPicture] | None = None
        self._of: str | None = None  # the text whose picture this is
        self._tried: list[Edit] = []  # what is dragged makes of it
        self._forces: tuple[int, float] = (0, 0.0)  # the state whose forces these are; [m/N]
        self._frames, self._each = 0, 1  # of drags; of so many one has forces
        self._pulled: Array | None = None  # coordinates of a machine that is turned by hand
        self._found: dict[str, dict[str, Any]] = {}
        try:
            self._refresh()
            self._shown = self.state()
        except Exception as error:
            self._give_up(error)

    # --- what is asked for ------------------------------------------------------------------

    def handle(self, message: Mapping[str, Any]) -> None:
        """Do what a page asks for, and show what came of it; or say why it cannot be."""
        acts: dict[str, Callable[[Mapping[str, Any]], None]] = {
            'drag': self._drag, 'drop': self._drop, 'pull': self._pull, 'draw': self._draw,
            'set': self._set, 'remove': self._remove, 'rename': self._rename,
            'select': self._select, 'trace': self._trace, 'text': self._replace,
            'undo': lambda _: self.document.undo(), 'redo': lambda _: self.document.redo(),
            'save': self._save, 'open': self._open,
        }  # fmt: skip
        kind = str(message.get('type'))
        if kind not in acts:
            return
        try:
            acts[kind](message)
        except (InputError, RunError) as error:
            self._say(str(error))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError):
            self._say('that was no command of this page')
        except Exception as error:  # whatever a message raises, all pages go on
            self._say(f'that is not possible ({reason(error)})')
        if kind not in ('drag', 'pull'):
            self._grabbed, self._tried, self._pulled = None, [], None
            try:
                self._refresh()
                self._show()
            except Exception as error:
                self._give_up(error)
                self._send(self._shown)

    def _give_up(self, error: Exception) -> None:
        """Show no picture of a document whose picture cannot be made."""
        self._heavy[self.document.text] = f'it cannot be drawn ({reason(error)})'
        self._of = None
        self._picture = SessionPicture(Document().scene(), None, {GROUND: ORIGIN}, '')
        self._refresh()
        self._shown = self.state()

    def state(self) -> dict[str, Any]:
        """All that a page shows."""
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
            'tracks': self._tracks(picture),
            'problem': picture.problem,
            'place': _place_of(picture.problem, content),
            **self._drawn(picture),
        }

    @property
    def chosen(self) -> Chosen:
        """Choices of those who edit: what is shown beside the document."""
        return self._path, self._traced

    @property
    def greeting(self) -> list[dict[str, Any]]:
        """Messages for a page that has just been opened."""
        return [self._shown, *self._found.values()]

    def job(self) -> Job | None:
        """Document to be checked and run, as it is dragged; None if it is none."""
        try:
            return Job(self.number, self.document.name, self.document.whole(self._tried))
        except InputError:
            return None

    def found(self, number: int, kind: str, data: Any) -> None:
        """Show what came of a job, if it is of the document as it is."""
        if number != self.number:
            return
        if kind == 'problem' and not self._grabbed:
            self._picture = self._picture._replace(problem=data)
            self._show()
        message = {'type': kind, 'data': data, 'number': number}
        self._found[kind] = message
        self._send(message)

    def pause(self) -> None:
        """Show the forces of ideal joints, if that is not done: nobody asks for anything now."""
        if self._forces[0] == self.number or self._grabbed:
            return
        if self._picture.turn is None:
            self._forces = self.number, 0.0
            return
        turn, scale = self._picture.turn, 0.0
        try:
            known = turn.forces() if turn else None
        except Exception:  # there are no forces to be shown
            known = None
        if turn and known:
            stage = self._shown['stage']
            largest = float(np.hypot(*known.forces.transpose(2, 0, 1)).max(initial=0.0))
            scale = _ARROW * 60.0 * stage['symbol'] / largest if largest else 0.0
        self._forces = self.number, scale
        if known and scale:
            data = _of_forces(known, scale)
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
            if parts > MOST_PARTS:
                raise InputError(
                    f'{self.document.name}: its {parts} links and joints are not drawn, for that '
                    f'takes too long: allowed are {MOST_PARTS}; check and solve take more'
                )
        except InputError as error:
            self._picture = self._picture._replace(problem=str(error))
            return
        self._picture = self._seen(scene, None)

    def _seen(
        self,
        scene: Scene,
        near: Poses | None,
        loops: Kinematics | None = None,
        machine: Machine | None = None,
    ) -> SessionPicture:
        old = self._picture
        try:
            machine = machine or Machine(self.document.name, scene)
            turn = Turn(machine, near, old.turn, loops)
        except (InputError, RunError, ArithmeticError, np.linalg.LinAlgError) as error:
            poses = placed(scene, near or old.poses)
            return SessionPicture(scene, None, {**poses, **(near or {})}, str(error))
        return SessionPicture(scene, turn, turn.start, '')

    def _drawn(self, picture: SessionPicture) -> dict[str, Any]:
        curves: dict[str, Any] = {}
        traced: dict[str, Any] = {}
        if picture.turn:
            points = picture.turn.machine.plan.points
            every = (
                (f'{link}.{x}', link, at) for link, own in points.items() for x, at in own.items()
            )
            traced = {key: [link, at] for key, link, at in every if self._has_path(key)}
            symbol = self._shown['stage']['symbol'] if self._grabbed else 0.0
            stage, curves = drawing.of_machine(picture.turn, traced, symbol)
        else:
            stage = drawing.of_parts(picture.scene, picture.poses)
        return {
            'stage': {'scene': self.document.name, **stage},
            'poses': [picture.poses[link] for link in stage['links']],
            'handles': [h.to_json() for h in drawing.handles(picture.scene, picture.poses)],
            'curves': curves,
            'traced': {} if curves else traced,
            'marks': drawing.marks(picture.scene),
            'assembled': picture.turn is not None,
        }

    def _has_path(self, point: str) -> bool:
        """True if the path of a point is drawn: of named ones, if nobody says otherwise."""
        link, _, name = point.partition('.')
        return self._traced.get(point, name not in ('start', 'end') and link != GROUND)

    def _tracks(self, picture: SessionPicture) -> list[tuple[str, bool]]:
        """The points of the link that is chosen, and whether their paths are drawn."""
        link = self._path[1] if self._path[:1] == ('links',) and len(self._path) == 2 else ''
        if link in ('', GROUND) or link not in picture.scene.links:
            return []
        points = (f'{link}.{name}' for name in points_of(picture.scene.links[link]))
        return [(point, self._has_path(point)) for point in points]

    def _handle(self, key: Any, picture: SessionPicture | None = None) -> Handle:
        picture = picture or self._picture
        for handle in drawing.handles(picture.scene, picture.poses):
            if handle.key == key:
                return handle
        raise InputError('there is nothing there any more')

    def _grid(self, message: Mapping[str, Any]) -> Grid:
        step = float(message['step'])
        if not 1e-9 < step < 1e3:
            raise InputError('that is too fine or too coarse')
        return Grid(step, unit_of(self.document.content().get('links')) or 'mm')

    # --- gestures ---------------------------------------------------------------------------

    def _moved(self, message: Mapping[str, Any]) -> tuple[list[Edit], SessionPicture]:
        """Document after a handle is moved, and its picture."""
        key, grid = str(message['handle']), self._grid(message)
        if self._grabbed is None or self._grabbed[0] != key:
            self._grabbed = key, self._picture
        before = self._grabbed[1]
        to = _place(message)
        handle = self._handle(key, before)
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
            return edits, self._seen(scene, poses)
        tree = loops.mechanism
        q, left = loops.positions(coordinates(tree, poses)[:, None])
        if not left[0]:
            found = dict(zip(tree.coordinates, q[:, 0].tolist(), strict=True))
            if more := gestures.starts(scene, found, tree.displacements, grid):
                edits, made = [*edits, *more], None
                scene = self.document.scene(edits)
        return edits, self._seen(scene, poses, loops, made)

    def _drag(self, message: Mapping[str, Any]) -> None:
        begun = time.thread_time()
        edits, self._picture = self._moved(message)
        if list(edits) != self._tried:
            self._tried = list(edits)
            self.number += 1
        frame = {'type': 'frame', 'number': self.number, 'problem': self._picture.problem}
        frame |= self._drawn(self._picture)
        frame |= self._dragged_forces(begun)
        self._send(frame)

    def _dragged_forces(self, begun: float) -> dict[str, Any]:
        """Forces for a frame of a drag; where they take too long for each, for one of some."""
        self._frames += 1
        turn, scale = self._picture.turn, self._forces[1]
        if not scale or self._frames % self._each:
            return {} if scale and turn else {'forces': None}
        try:
            known = turn.forces(1) if turn else None
        except (InputError, RunError, ArithmeticError, np.linalg.LinAlgError):
            known = None
        self._each = 1 if time.thread_time() < begun + _BUDGET else _SOME
        return {'forces': _of_forces(known, scale) if known else None}

    def _drop(self, message: Mapping[str, Any]) -> None:
        self._of = None  # what was dragged goes back, if it cannot stay
        edits, picture = self._moved(message)
        self.document.change([*edits, *self._chosen(edits, picture)])

    def _chosen(self, edits: list[Edit], picture: SessionPicture) -> list[Edit]:
        """Guesses, or the other branch, where the scene alone would close its loops otherwise."""
        if picture.turn is None:
            return []
        scene = self.document.scene(edits)
        try:
            turn = Turn(Machine(self.document.name, scene))
        except InputError:
            turn = None
        tree = picture.turn.mechanism
        size = np.where([c in tree.displacements for c in tree.coordinates], tree.size, 1.0)
        if turn is not None:
            off = turn.q[:, 0] - picture.turn.q[:, 0]
            off = np.where(size == 1.0, np.remainder(off + np.pi, 2.0 * np.pi) - np.pi, off / size)
            if np.abs(off).max(initial=0.0) < _FAR:
                return []
        content = self.document.content()
        if content.get('mechanism') == 'four_bar':
            crossed = content.get('branch') != 'crossed'
            return [Edit(('branch',), 'crossed' if crossed else GONE)]
        q = dict(zip(tree.coordinates, picture.turn.q[:, 0].tolist(), strict=True))
        return [
            Edit(('guess', c), f'{x:.3g} m' if c in tree.displacements else degrees(x))
            for c, x in q.items()
            if c in picture.scene.links and c not in picture.turn.machine.plan.laws
        ]

    def _pull(self, message: Mapping[str, Any]) -> None:
        """Move the machine along its way, so that a handle comes nearest to a place."""
        turn = self._picture.turn
        if turn is None or not turn.q.size:
            raise InputError('what is no machine yet cannot be turned by hand')
        handle = self._handle(message['handle'])
        link, name = next(((x, n) for x, n in handle.members if x != GROUND), ('', ''))
        if not link:
            return
        at = turn.machine.plan.points[link][name]
        links = [body.name for body in turn.mechanism.bodies]
        if not turn.moves:  # whichever way its several motions let it
            before = turn.q[:, 0] if self._pulled is None else self._pulled
            self._pulled = turn.reached(before, link, at, _place(message))
            poses = turn.poses_of(self._pulled)
            self._send({'type': 'pose', 'instant': 0, 'poses': [poses[link] for link in links]})
            return
        x, y = turn.mechanism.locate_all(link, turn.q, at)
        to = _place(message)
        k = int(np.argmin(np.hypot(x - to[0], y - to[1])))
        poses = turn.poses_at(k)
        self._send({'type': 'pose', 'instant': k, 'poses': [poses[link] for link in links]})

    def _draw(self, message: Mapping[str, Any]) -> None:
        grid, what = self._grid(message), str(message['what'])
        start, end = (self._spot(message[key]) for key in ('from', 'to'))
        before, picture = self.document.text, self._picture
        sketch = Sketch(picture.scene, picture.poses, grid)
        edits = palette.draw(sketch, what, start, end)
        if written := self._written_out():
            try:
                self.document.scene(edits)
            except InputError:  # the short form cannot say it
                edits = [*written, *edits]
        self.document.change([*edits, *self._as_drawn(edits, sketch.poses)])
        if self.document.text != before and edits:
            path = edits[0].path
            self._path = path[: 1 if path[0] == 'drive' else 2]

    def _as_drawn(self, edits: list[Edit], poses: Poses) -> list[Edit]:
        """Guesses, where what was drawn would be assembled in another way than it was drawn."""
        try:
            scene = self.document.scene(edits)
            return self._chosen(edits, self._seen(scene, placed(scene, poses)))
        except InputError:
            return []  # it is no machine yet

    def _spot(self, data: Mapping[str, Any]) -> Spot:
        handle = self._handle(data['handle']) if data.get('handle') else None
        link = '' if handle else str(data.get('link') or '')
        link = link if link in self._picture.scene.links and link != GROUND else ''
        return Spot(_place(data), handle, link)

    # --- the panel --------------------------------------------------------------------------

    def _set(self, message: Mapping[str, Any]) -> None:
        path, text = _path(message), str(message['text'])
        if not text.strip():
            self.document.change([Edit(path, GONE)])
            return
        try:
            value = documents.parse(text)
            documents.check(value, path)
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
                f"'{name}' cannot be its name: take letters, digits and _, and none that is taken"
            )
        short = self._written_out() if path[0] in ('links', 'joints') else []
        self.document.rename(path, name, short)
        self._path = (*path[:-1], name)

    def _select(self, message: Mapping[str, Any]) -> None:
        self._path = _path(message)

    def _trace(self, message: Mapping[str, Any]) -> None:
        point = str(message['point'])
        self._traced[point] = not self._has_path(point)

    def _replace(self, message: Mapping[str, Any]) -> None:
        self.document.replace(str(message['text']))

    # --- files ------------------------------------------------------------------------------

    def _save(self, message: Mapping[str, Any]) -> None:
        self._say(f'saved: {self.document.save(str(message.get("name") or ""))}')

    def _open(self, message: Mapping[str, Any]) -> None:
        name = str(message.get('name') or '')
        if name and name not in scene_names():
            raise InputError(f"there is no scene '{name}' in the package")
        document = Document.open(name) if name else Document()
        document.watch, watch = self.document.watch, self.document.watch
        self.document = document
        watch('opened', document)
        self._path, self._traced = (), {}
        self._picture = SessionPicture(Document().scene(), None, {GROUND: ORIGIN}, '')
        self._of = None

    def _written_out(self) -> list[Edit]:
        """Edits that make a four-bar in short the linkage that it stands for."""
        scene, content = self._picture.scene, self.document.content()
        if content.get('mechanism') != 'four_bar':
            return []
        edits = [Edit(('mechanism',), 'linkage')]
        edits += [Edit(('branch',), GONE)] if 'branch' in content else []
        for name, joint in scene.joints.items():
            edits.append(Edit(('joints', name, 'revolute'), list(joint.points)))
        for key, value in (('coordinate', 'crank'), ('start_angle', '0 deg')):
            if key not in content.get('drive', {}):
                edits.append(Edit(('drive', key), value))
        for link, angle in scene.guess.items():
            edits.append(Edit(('guess', link), degrees(angle.value)))
        return edits


def _of_forces(known: IdealForces, scale: float) -> dict[str, Any]:
    """Forces for the page: of N, and of metres a thousandth of a symbol, nobody sees less."""
    return {
        'joints': known.joints,
        'force_scale': scale,
        'forces': [[[float(f'{x:.4g}') for x in f] for f in row] for row in known.forces],
        'feet': np.round(known.feet, 7).tolist(),
    }


def _place(message: Mapping[str, Any]) -> tuple[float, float]:
    """A place on the sheet [m]."""
    x, y = float(message['x']), float(message['y'])
    if not max(abs(x), abs(y)) <= FARTHEST:
        raise InputError(f'that is too far away: the sheet ends {FARTHEST:g} m from its middle')
    return x, y


def _path(message: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(part) for part in message['path'])


def _place_of(problem: str, content: Mapping[str, Any]) -> list[str]:
    """The path of a scene that a sentence names, as far as it is there; empty if none."""
    best: list[str] = []
    for word in re.findall(r'[A-Za-z_]\w*(?:\.\w+)*', problem):
        parts = word.split('.')
        if parts[0] not in content and parts[0] not in ('drive', 'duration', 'start'):
            continue
        if len(parts) > len(best) and (len(parts) > 1 or f"'{word}'" in problem):
            best = parts
    return best
