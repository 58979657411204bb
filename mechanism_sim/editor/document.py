"""The document that is edited: the text of a scene, what was done to it, and its file."""

from __future__ import annotations

import copy
import re
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mechanism_sim import documents, output
from mechanism_sim.catalogue import config_folder
from mechanism_sim.editor.scene_text import renamed, with_value, without
from mechanism_sim.editor.sketch import GONE, Edit
from mechanism_sim.errors import InputError
from mechanism_sim.imports import import_machine, is_importable
from mechanism_sim.scene.files import check_scene, find_scene
from mechanism_sim.scene.schema import Scene
from mechanism_sim.scene.table_keys import with_files

_NEW = 'title: A new machine\nmechanism: linkage\nlinks: {}\njoints: {}\n'

_KEPT = 500  # states in the undo history


class Document:
    """A scene as text, with all texts before."""

    def __init__(self, text: str = _NEW, file: Path | None = None, name: str = 'machine') -> None:
        self.text = text  #: text of the YAML file
        self.file = file  #: path of the file; None for a new document
        self.name = name  #: name of the scene
        self._before: list[str] = []
        self._after: list[str] = []
        self._saved = self._clean = text
        self._folder = file.parent if file else Path()
        self._content: tuple[str, dict[str, Any]] | None = None
        #: callback with every change, as for `follow`
        self.watch: Callable[[str, Any], None] = _nobody

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), 'watch': _nobody, '_content': None}

    @classmethod
    def open(cls, scene: str) -> Document:
        """A scene of the package by name, of which a copy is edited, or a file of any program."""
        if is_importable(scene):
            found = import_machine(scene)
            made = cls(found.text, Path(f'{found.name}.yaml'), found.name)
            made._saved = ''
            return made
        path = find_scene(scene)
        documents.read(path, 'scene')  # of bounded size, in UTF-8, one document
        text = path.read_bytes().decode()
        own = path.resolve().parent != config_folder().resolve()
        made = cls(text, path if own else Path(path.name), path.stem)
        made._folder = path.parent
        made._saved = text if own else ''
        return made

    @classmethod
    def dropped(cls, name: str, text: str) -> Document:
        """Document of an uploaded file of any program, by name and text, saved in the folder."""
        name = Path(name).name
        if Path(name).suffix.lower() not in ('.yaml', '.yml') and not is_importable(name):
            raise InputError(
                f"'{name}' is not a machine: drop a scene, .yaml, or a file of another program "
                "that 'mechanism-sim import' reads"
            )
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / name
            file.write_text(text, 'utf-8')
            made = cls.open(str(file))
        made.file, made._folder, made._saved = Path(f'{made.name}.yaml'), Path(), ''
        return made

    @property
    def changed(self) -> bool:
        """True if the text differs from that of the file."""
        return self.text != self._clean

    @property
    def base(self) -> str:
        """The text of the file from which it was changed; empty if there is no such file."""
        return self._saved

    @property
    def steps(self) -> tuple[int, int]:
        """Numbers of steps that can be undone and redone."""
        return len(self._before), len(self._after)

    def content(self) -> dict[str, Any]:
        """Keys and values of the text."""
        if self._content is None or self._content[0] != self.text:
            try:
                found = documents.parse(self.text)
            except documents.DocumentError as error:
                raise InputError(f'{self.name}:{error}') from error
            if not isinstance(found, dict):
                raise InputError(f'{self.name}: a scene is a list of keys with values')
            self._content = self.text, found
        return self._content[1]

    def scene(self, edits: Iterable[Edit] = ()) -> Scene:
        """The scene that the document is, or would be with some edits."""
        return check_scene(self.name, self.whole(edits))

    def whole(self, edits: Iterable[Edit] = ()) -> dict[str, Any]:
        """Keys and values with some edits, those of files that it names among them."""
        content: Any = self.content()
        edits = list(edits)
        if edits:
            content = copy.deepcopy(content)
            for edit in edits:
                _apply(content, edit)
        found: dict[str, Any] = with_files(self.name, self._folder, content)
        return found

    def change(self, edits: Iterable[Edit]) -> None:
        """Make edits, which are undone together."""
        self.replace(self._with(edits))

    def _with(self, edits: Iterable[Edit]) -> str:
        text = self.text
        for path, value in edits:
            text = without(text, path) if value is GONE else with_value(text, path, value)
        return text

    def rename(self, path: tuple[str, ...], name: str, edits: Iterable[Edit] = ()) -> None:
        """Give a part another name, and wherever the scene names it; first, some edits."""
        old, text = path[-1], self._with(edits)
        content = documents.parse(text)
        for where, value in documents.texts_of(content):
            found = _renamed_in(path, where, value, name)
            if found != value:
                text = with_value(text, where, found)
        if path[0] == 'links':  # coordinates are named after links
            drive = content.get('drive') or {}
            if old == 'crank' and 'coordinate' not in drive and drive:
                text = with_value(text, ('drive', 'coordinate'), name)
            for section in ('drives', 'guess', 'initial'):
                for inner in ((), ('position',), ('velocity',)):
                    text = renamed(text, (section, *inner, old), name)
        self.replace(renamed(text, path, name))

    def replace(self, text: str) -> None:
        """Take another text."""
        if text == self.text:
            return
        try:
            text.encode()
        except UnicodeEncodeError as error:
            where, half = text.count('\n', 0, error.start) + 1, ord(text[error.start])
            raise InputError(
                f'{self.name}:{where}: an incomplete character (U+{half:04X}) cannot be saved'
            ) from error
        if len(text) > documents.LARGEST:
            raise InputError(f'{self.name}: is larger than {documents.LARGEST} bytes')
        self._before = [*self._before, self.text][-_KEPT:]
        self._after.clear()
        self.text = text
        self.watch('replace', text)

    def undo(self) -> None:
        """Go back to the text before the last edit, if there is one."""
        if self._before:
            self._after.append(self.text)
            self.text = self._before.pop()
            self.watch('undo', None)

    def redo(self) -> None:
        """Do again what was undone last."""
        if self._after:
            self._before.append(self.text)
            self.text = self._after.pop()
            self.watch('redo', None)

    def follow(self, change: str, value: Any) -> None:
        """Repeat a change of another document, as passed to its `watch`."""
        if change == 'replace':
            self.replace(value)
        elif change == 'undo':
            self.undo()
        elif change == 'redo':
            self.redo()
        else:
            self.file, self.name, self._folder, self._saved = value
            self._clean = self._saved

    def save(self, name: str = '') -> Path:
        """Write the file; of a given name, ending in .yaml, below the folder of the program."""
        file = self.file or Path('machine.yaml')
        if name:
            file = Path(name if name.endswith(('.yaml', '.yml')) else f'{name}.yaml')
        inside = not file.is_absolute() and '..' not in file.parts and _stays(file)
        if file.stem.startswith('.') or not (inside or file == self.file):
            raise InputError(f"'{name}' is not a scene name: write for example my_machine")
        with output.errors_as_sentences(file):
            there = _text_there(file)
        own = self.file is not None and file == self.file
        if there is not None and there not in ((self._saved, self.text) if own else (self.text,)):
            reason = 'was changed by another program' if own and self._saved else 'exists already'
            raise InputError(f"'{file}' {reason}: save under another name")
        output.write_text(file, self.text, devices=False)
        self.file, self.name, self._folder = file, file.stem, file.parent
        self._saved = self._clean = self.text
        self.watch('saved', (self.file, self.name, self._folder, self._saved))
        return file


def _stays(file: Path) -> bool:
    """True if a name leads to a place below the folder of the program, with all links followed."""
    try:
        return file.resolve().is_relative_to(Path().resolve())
    except (OSError, RuntimeError, ValueError):  # invalid names are reported on opening
        return True


def _nobody(_change: str, _value: Any) -> None:
    """Default of `watch`: ignore the change."""


def _text_there(file: Path) -> str | None:
    """Text of a file, if a document may hold it; None if it cannot be read."""
    try:
        return documents.bytes_of(file, documents.LARGEST).decode(errors='replace')
    except FileNotFoundError:
        return None


def _apply(content: Any, edit: Edit) -> None:
    *path, last = edit.path
    for part in path:
        if isinstance(content, list):
            content = content[int(part)]
        else:
            content[part] = {} if content.get(part) is None else content[part]
            content = content[part]
    if edit.value is GONE:
        content.pop(last, None)
    else:
        content[int(last) if isinstance(content, list) else last] = edit.value


def _renamed_in(path: tuple[str, ...], where: tuple[str, ...], value: str, new: str) -> str:
    """A text with another name for a part, wherever it names the part or a point of it."""
    section, old = path[0], path[-1]
    word = rf'{re.escape(old)}(?=(_rate)?(?!\w))'
    if where[0] in ('title', 'description', 'mechanism') or len(path) != 2:
        return value
    if where[0] == 'measures':
        return re.sub(rf'(?<!\w){word}', new, value)
    if section == 'links' and not (where[0] == 'joints' and where[2] == 'mesh'):
        return re.sub(rf'(?<![\w.]){word}', new, value)
    names = {'gears': 'joints', 'joints': 'sensors'}.get(section)
    keys = {'gears': 'mesh', 'joints': 'joint'}.get(section)
    return new if where[0] == names and keys in where and value == old else value
