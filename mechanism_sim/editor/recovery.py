"""Recovery of edits that were not saved, from a file beside the document."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from itertools import count
from pathlib import Path

from mechanism_sim import documents, output
from mechanism_sim.editor.document import Document
from mechanism_sim.errors import InputError, RunError

_LONGEST = 200  # bytes of a name to which a suffix is added
_EDITED = '# not saved, of the text with the SHA-256 '
_GIVEN_BACK = 'unsaved changes have been restored; undo returns to the file as saved'


def place(document: Document) -> Path:
    """Path of the recovery file of a document: ``.NAME.yaml.unsaved`` beside its file."""
    file = document.file or Path('machine.yaml')
    name = file.name
    if len(os.fsencode(name)) > _LONGEST:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()[:32]
    return file.with_name(f'.{name}.unsaved')


class UnsavedEdits:
    """Store of the unsaved text of a document, restored when it is opened again."""

    def __init__(self) -> None:
        self._kept: tuple[Path, bytes] | None = None

    def give_back(self, document: Document) -> tuple[str, str]:
        """The text of an earlier edit that was not saved, and a sentence on it; empty if none.

        If the file has been changed since, the text goes into another file, for both to be seen.
        """
        file, self._kept = place(document), None
        with suppress(OSError, UnicodeDecodeError):
            if file.is_symlink() or file.lstat().st_uid != os.geteuid():
                return '', ''
            data = documents.bytes_of(file, documents.LARGEST + len(_heading('')))
            base, text = _parts(data.decode())
            self._kept = file, data
            if len(text.encode()) > documents.LARGEST or text == document.text:
                return '', ''
            if base in ('', _heading(document.base)):
                return text, _GIVEN_BACK
            return '', self._put_aside(file, text, document)
        return '', ''

    def keep(self, document: Document) -> str:
        """Write unsaved text, or remove the file of saved text; a sentence if this fails."""
        file = place(document)
        if self._kept and (not document.changed or self._kept[0] != file):
            if _holds(*self._kept):  # the text was saved, perhaps under another name
                with suppress(OSError):
                    self._kept[0].unlink(missing_ok=True)
            self._kept = None
        if not document.changed:
            return ''
        text = _heading(document.base) + document.text
        if self._kept == (file, text.encode()) and _holds(*self._kept):
            return ''
        try:
            output.write_text(file, text, devices=False)
        except (InputError, RunError, OSError, ValueError) as error:
            return f'unsaved changes cannot be kept either: {error}'
        self._kept = file, text.encode()
        return ''

    def _put_aside(self, file: Path, text: str, document: Document) -> str:
        name = document.file or Path('machine.yaml')
        names = (name.with_stem(f'{name.stem}.unsaved{k}') for k in count(1))
        aside = next(free for free in names if not os.path.lexists(free))
        changed = f"'{name}' was changed by another program after an edit that was not saved"
        try:
            output.write_text(aside, text, devices=False)
        except (InputError, RunError, OSError, ValueError) as error:
            return f"{changed}, which is in '{file}', without its first line: {error}"
        with suppress(OSError):
            file.unlink()
        self._kept = None
        return f"{changed}: that is in '{aside}' now"


def _heading(base: str) -> str:
    """First line of a recovery file: identifies the text that was edited."""
    return f'{_EDITED}{hashlib.sha256(base.encode()).hexdigest()}\n'


def _parts(kept: str) -> tuple[str, str]:
    """The heading, if it has one, and the text."""
    if not kept.startswith(_EDITED):
        return '', kept
    first, _, text = kept.partition('\n')
    return f'{first}\n', text


def _holds(file: Path, data: bytes) -> bool:
    """True if a file has exactly this content: another editor may have changed it."""
    with suppress(OSError):
        return not file.is_symlink() and documents.bytes_of(file, len(data)) == data
    return False
