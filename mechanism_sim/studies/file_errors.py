"""Errors of files that the runs of a sweep write."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mechanism_sim.errors import InputError, RunError


class FileError(RunError):
    """A bag or a file of windows cannot be written: this ends the sweep, not only the run."""


@contextmanager
def file_errors(file: Path | None = None) -> Iterator[None]:
    """Raise `FileError` where a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise FileError(f"'{file}' cannot be written: {error.strerror or error}") from error
    except (InputError, RunError) as error:
        raise FileError(str(error)) from error
