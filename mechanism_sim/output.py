"""Files that commands write: complete under their name, or not there, and one sentence.

A file is written beside its place and renamed, so that a full disk or a kill never leaves a piece
that looks like a result, nor costs the one that was there before.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mechanism_sim.errors import InputError, RunError

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE}
"""Errors that are no fault of the name that was given."""


_LONGEST = 180  # bytes of a name's beginning, of 255 that file systems allow with all we add


def path_of(given: str | os.PathLike[str]) -> Path:
    """A path; ``~`` is the home folder, as in shells."""
    return Path(os.path.expanduser(given))  # that of `Path` raises where there is no home


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
    except InputError:
        raise
    except ValueError as error:  # a zero byte in a name, or what no name can be written as
        raise InputError(f"'{path}' is not a valid file name: {error}") from error


@contextmanager
def beside(path: Path | str, devices: bool = True) -> Iterator[Path]:
    """Temporary path of a file that gets its name when complete; see `errors_as_sentences`.

    The name keeps its ending. What is there keeps its mode, its owner and its links; a symbolic
    link stays one. The file that is written is a new one of a name that nobody knows before.

    Parameters
    ----------
    devices : True if devices and pipes are written themselves; else they are refused
    """
    named = Path(path)
    with errors_as_sentences(named):
        target = _resolved(named)
        try:
            kept = target.stat()
        except FileNotFoundError:
            kept = None
        if kept is not None and not stat.S_ISREG(kept.st_mode):
            if not devices:
                raise InputError(f"'{path}' cannot be written: it is not a file")
            yield target
            return
        if kept is not None and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        part = _new_part(target, 0o666 if kept is None else 0o600)
        try:
            yield part
            with part.open('rb') as file:
                os.fsync(file.fileno())
            if kept is None or _made_like(part, kept):
                part.replace(target)
            else:
                _rewrite(part, target, kept)
        finally:
            part.unlink(missing_ok=True)


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except RuntimeError as error:  # of pathlib, for links in a circle
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from error


def _new_part(target: Path, mode: int) -> Path:
    """A new empty file beside another, for what is written in its place."""
    stem = target.stem.encode('utf-8', 'surrogateescape')[:_LONGEST].decode('utf-8', 'ignore')
    suffix = target.suffix if len(target.suffix) < _LONGEST // 4 else ''
    part = target.with_name(f'.{stem}.{secrets.token_hex(4)}.part{suffix}')
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    os.close(os.open(part, flags, mode))
    return part


def _made_like(part: Path, kept: os.stat_result) -> bool:
    """Give a file owner, mode and attributes of the one it replaces; whether it can do so."""
    if kept.st_nlink > 1:  # its other names would go on to show what was in it
        return False
    try:
        if (kept.st_uid, kept.st_gid) != (os.geteuid(), part.stat().st_gid):
            os.chown(part, kept.st_uid, kept.st_gid)
        part.chmod(stat.S_IMODE(kept.st_mode))
    except PermissionError:
        return False
    return True


def _rewrite(part: Path, target: Path, kept: os.stat_result) -> None:
    """Copy a complete file into another that has to stay the same one.

    The room for it is taken first, so that a full disk costs nothing of what is there.
    """
    flags = os.O_WRONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    with part.open('rb') as source, open(os.open(target, flags), 'wb', buffering=0) as file:
        number, size = file.fileno(), os.fstat(source.fileno()).st_size
        found = os.fstat(number)
        if (found.st_dev, found.st_ino) != (kept.st_dev, kept.st_ino):
            raise OSError(errno.ESTALE, 'it was replaced by another one meanwhile')
        if size > kept.st_size and hasattr(os, 'posix_fallocate'):
            os.posix_fallocate(number, 0, size)
        shutil.copyfileobj(source, file)
        os.ftruncate(number, size)
        os.fsync(number)


def check_path(option: str, file: Path | str, *suffixes: str, new: bool = False) -> Path:
    """A path that can be written to, checked before anything is computed.

    Parameters
    ----------
    option : option of the command line, for the message
    suffixes : allowed endings
    new : True if no file may exist
    """
    path = Path(file)
    if path.suffix not in suffixes:
        *others, last = suffixes
        words = f'{", ".join(others)} or {last}' if others else last
        raise InputError(f'{option} {file}: the ending must be {words}')
    with errors_as_sentences(file):
        found, there = _resolved(path).parent.is_dir(), path.exists()
    if not found:
        raise InputError(f"{option} {file}: there is no directory '{path.parent}'")
    if new and there:
        raise InputError(
            f'{option} {file}: exists already, not overwriting: choose another name, or remove it'
        )
    return path


def make_folder(path: Path, what: str = '') -> Path:
    """A folder that is made, with those above it, if it is not there; `what` is it for."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{what}'{path}' cannot be made: {error.strerror}") from error
    return path


def write_text(path: Path | str, text: str, devices: bool = True) -> None:
    """Write a text in UTF-8; raises what `errors_as_sentences` does."""
    write_bytes(path, text.encode('utf-8'), devices)


def write_bytes(path: Path | str, data: bytes, devices: bool = True) -> None:
    """Write bytes; raises what `errors_as_sentences` does."""
    with beside(path, devices) as part:
        part.write_bytes(data)
