"""Exit code of a program, with one sentence on standard error for a failure."""

from __future__ import annotations

import errno
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn

from mechanism_sim import process_exit
from mechanism_sim.cli.options import PRINTED, print_json
from mechanism_sim.errors import InputError, RunError, RunWarning
from mechanism_sim.packages import refusal
from mechanism_sim.terminal import print_error, print_notice
from ros_interfaces.streams import mute_output

_GONE = errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO


def carry_out(work: Callable[[], int], given: Sequence[str]) -> NoReturn:
    """Do the work of a command line and exit with the code that it returns.

    Exit code 1 is a failed run, 2 bad input, 130 interrupted. `given` are the words of the command
    line: with ``--json`` among them an error is printed as JSON, too.
    """
    PRINTED.clear()
    warnings.showwarning = partial(_print_warning, warnings.showwarning)
    try:
        with process_exit.working():
            try:
                code: Any = work()
            except SystemExit as ended:  # after --help
                code = ended.code
            sys.stdout.flush()
        sys.exit(code)
    except InputError as error:
        sys.exit(_report_failure(error, 2, given))
    except RunError as error:
        sys.exit(_report_failure(error, 1, given))
    except MemoryError as error:
        much = f': {error}' if str(error) else ''
        needed = InputError(f'this needs more memory than there is{much}; ask for less of it')
        sys.exit(_report_failure(needed, 2, given))
    except KeyboardInterrupt as interrupted:
        sys.exit(process_exit.report_signal(str(interrupted)))
    except BrokenPipeError:
        # The reader has closed the pipe.
        mute_output()
        sys.exit(0)
    except Exception as error:
        refused = refusal(error)
        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
            refused = InputError(f"'{str(error.filename)[:60]}...' is too long a name for a file")
        if refused is not None:
            sys.exit(_report_failure(refused, 2, given))
        if not isinstance(error, OSError) or error.errno not in _GONE:
            raise
        mute_output()
        where = f"'{error.filename}'" if error.filename else 'the output'
        sys.exit(print_error(RunError(f'{where} cannot be written: {error.strerror}'), 1))


def _print_warning(
    others: Callable[..., None], message: Warning | str, *more: Any, **named: Any
) -> None:
    """Show a warning about a run as one sentence, without its line of code."""
    if isinstance(message, RunWarning):
        print_notice(str(message))
    else:
        others(message, *more, **named)


def _report_failure(error: Exception, code: int, args: Sequence[str]) -> int:
    """Print an error; as JSON, too, with `--json` if nothing is printed yet."""
    if '--json' in args and 'node' not in args[:1] and not PRINTED:
        try:
            print_json({'error': str(error), 'code': code})
            sys.stdout.flush()
        except OSError:  # closed or full: standard error has it
            mute_output()
    return print_error(error, code)
