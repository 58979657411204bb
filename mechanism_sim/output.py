"""Files that commands write: complete under their name, or not there, and one sentence.

A file is written beside its place and renamed, so that a full disk or a kill never leaves a piece
that looks like a result, nor costs the one that was there before.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mechanism_sim.errors import InputError, RunError

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE}
"""What is no fault of the name that was given."""


@contextmanager
def errors_as_sentences(path: Path | str) -> Iterator[None]:
    """Errors of the system while a file is written, as one sentence.

    Raises
    ------
    InputError
        If nothing can be written there.
    RunError
        If the disk is full or gone.
    """
    try:
        yield
    except OSError as error:
        kind = RunError if error.errno in _FULL else InputError
        raise kind(f"'{path}' cannot be written: {error.strerror or error}") from error


@contextmanager
def beside(path: Path | str) -> Iterator[Path]:
    """Where to write what gets its name when it is complete; raises what `told` does.

    The name keeps its ending. Devices and pipes are written themselves.
    """
    named = Path(path)
    with errors_as_sentences(named):
        target = named.resolve()
        if target.exists() and not target.is_file():
            yield target
            return
        part = target.with_name(f'.{target.stem}.part{target.suffix}')
        try:
            part.touch()  # before anybody works for it
            yield part
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)


def check_path(option: str, file: Path | str, *suffixes: str, new: bool = False) -> Path:
    """A path that can be written to, checked before anything is computed.

    Parameters
    ----------
    option : of the command line, for the message
    suffixes : of which its ending is one
    new : whether nothing may be there

    Raises
    ------
    InputError
    """
    path = Path(file)
    if path.suffix not in suffixes:
        *others, last = suffixes
        words = f'{", ".join(others)} or {last}' if others else last
        raise InputError(f'{option} {file}: the ending must be {words}')
    if not path.resolve().parent.is_dir():
        raise InputError(f"{option} {file}: there is no directory '{path.parent}'")
    if new and path.exists():
        raise InputError(f'{option} {file}: exists already, not overwriting')
    return path


def make_folder(path: Path, what: str = '') -> Path:
    """A folder that is made, with those above it, if it is not there; `what` is it for.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{what}'{path}' cannot be made: {error.strerror}") from error
    return path


def write_text(path: Path | str, text: str) -> None:
    """Write a text in UTF-8; raises what `told` does."""
    write_bytes(path, text.encode('utf-8'))


def write_bytes(path: Path | str, data: bytes) -> None:
    """Write bytes; raises what `told` does."""
    with beside(path) as part:
        part.write_bytes(data)
