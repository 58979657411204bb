"""Recovery of edits that were not saved, from a file beside the document."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from mechanism_sim import documents, output
from mechanism_sim.editor.document import Document
from mechanism_sim.errors import InputError, RunError

_LONGEST = 200  # bytes of a name to which something is added


def place(document: Document) -> Path:
    """Where what is not saved of a document is kept: ``.NAME.yaml.unsaved`` beside its file."""
    file = document.file or Path('machine.yaml')
    name = file.name
    if len(os.fsencode(name)) > _LONGEST:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()[:32]
    return file.with_name(f'.{name}.unsaved')


class UnsavedEdits:
    """Keeps the text of a document that is changed, and gives it back to who opens it again."""

    def __init__(self) -> None:
        self._kept: tuple[Path, str] | None = None

    def give_back(self, document: Document) -> str:
        """The text of an earlier edit that was not saved; empty if there is none."""
        file = place(document)
        with suppress(OSError, UnicodeDecodeError):
            if file.is_symlink() or file.lstat().st_uid != os.geteuid():
                return ''
            data = documents.bytes_of(file, documents.LARGEST)
            text = data.decode()
            self._kept = file, text
            return text if len(data) <= documents.LARGEST and text != document.text else ''
        return ''

    def keep(self, document: Document) -> str:
        """Write what is not saved, or remove what is; a sentence if that is not possible."""
        file = place(document)
        if not document.changed:
            if self._kept and self._kept[0] == file:
                with suppress(OSError):
                    file.unlink(missing_ok=True)
            self._kept = None
            return ''
        if self._kept == (file, document.text):
            return ''
        self._kept = file, document.text  # not again and again, where it is not possible
        try:
            output.write_text(file, document.text, devices=False)
        except (InputError, RunError, OSError, ValueError) as error:
            return f'unsaved changes cannot be kept either: {error}'
        return ''
