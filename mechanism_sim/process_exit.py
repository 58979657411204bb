"""End of this package's programs: one sentence at a signal, and with the parent process.

SIGINT, SIGTERM and SIGHUP end a program with exit code 130 from its first line on: `begin` comes
before all other imports. What it starts by `start` ends with it, even if it is killed.
"""

from __future__ import annotations

import atexit
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from threading import Thread, Timer
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor
    from subprocess import Popen

INTERRUPTED = 130
"""Exit code after a signal, as shells have it."""

_HANGUP = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)
SIGNALS = signal.SIGINT, signal.SIGTERM, *_HANGUP  # the last by a terminal that is closed

PARENT = 'MECHANISM_SIM_PARENT'
"""Environment variable: id of the parent process, with which it ends."""

LOOK = 0.1  # [s] between looks at the parent
_GRACE = 0.6  # [s] to end in good order without it
PATIENCE = 0.4  # [s] for the main thread to take in a signal
RETRY = 0.01  # [s] until an interrupt that came at a bad moment is tried again

_silent = False  # somebody else speaks for this process, or it has said already why it ends
_working = False  # there is something to be put in order
_holding = False  # a process is being started
_signals = -1  # end of the pipe into which signals put bytes, once `begin` was called
_noticed = 0.0  # [s] when a signal was taken in, by ``time.monotonic``
_patience = PATIENCE
_words: Callable[[], str] | None = None  # says what is kept


def begin() -> None:
    """Let this process end as the package has it."""
    global _silent, _signals  # noqa: PLW0603
    for number in SIGNALS:
        signal.signal(number, interrupt)
    _signals, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    Thread(target=_bound, args=[_signals], daemon=True).start()
    sys.unraisablehook = _unraisable
    atexit.register(_ignore)  # the first that is registered is called last
    parent = os.environ.pop(PARENT, '')
    if parent.isdecimal():
        _silent = True
        follow(int(parent))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


def signals() -> int:
    """The end of a pipe that holds a byte of each signal until a thread takes it; -1 for none."""
    return _signals


def follow(parent: int) -> None:
    """End this process when `parent` is gone, which started it and may be so already."""

    def wait() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_GRACE)
        quit_now()

    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
    Thread(target=wait, daemon=True).start()


def start(command: Sequence[str], **options: Any) -> Popen[Any]:
    """Start a program of this package, which ends with this process; `options` of Popen."""
    from subprocess import Popen  # noqa: PLC0415 - most commands start nothing

    with signals_held():
        return Popen(command, env=owned(options.pop('env', os.environ)), **options)  # noqa: S603


def owned(env: Mapping[str, str]) -> dict[str, str]:
    """The environment of a program of this package that this process starts, to end with it."""
    return {**env, PARENT: str(os.getpid())}


def one_thread() -> None:
    """Limit libraries of linear algebra to one thread: more wait busily, and round otherwise.

    They read it when they are loaded; who has loaded them before keeps his own.
    """
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')


@contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that compute for this one: they end at once when the block does."""
    from concurrent.futures import ProcessPoolExecutor  # noqa: PLC0415
    from multiprocessing import active_children, get_context  # noqa: PLC0415

    one_thread()
    before = set(active_children())
    pool = ProcessPoolExecutor(count, get_context('spawn'), follow, (os.getpid(),))
    try:
        yield pool
    finally:
        for process in set(active_children()) - before:
            process.kill()
        # Its thread and exit functions would close the same pipe twice, and complain.
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def signals_held() -> Iterator[None]:
    """While processes are started: they keep signals until they can take them, as we do."""
    global _holding  # noqa: PLW0603
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    _holding = True
    try:
        yield
    finally:
        _holding = False
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def working() -> Iterator[None]:
    """While there is something to be put in order: a signal is a KeyboardInterrupt."""
    global _working  # noqa: PLW0603
    _working = True
    try:
        yield
    finally:
        _working = False


def interrupted() -> int:
    """Exit code after a signal: 0 with ``--ros-args``, as launch files end their nodes by one."""
    return 0 if '--ros-args' in sys.argv else INTERRUPTED


def say_when_interrupted(words: Callable[[], str] | None) -> None:
    """Give the sentence for the time in which finished work is kept, from any thread; or none."""
    global _words  # noqa: PLW0603
    _words = words


def report_signal(text: str = '') -> int:
    """Report on standard error that a signal ended the program, once; returns the exit code."""
    global _silent  # noqa: PLW0603
    if not _silent:
        _silent = True
        with suppress(OSError):
            print(_sentence(text), file=sys.stderr, flush=True)
    return interrupted()


def _sentence(text: str = '') -> str:
    return f'mechanism-sim: {text or (_words() if _words else "interrupted")}'


def quit_now() -> None:
    """End at once, from any thread."""
    if not _silent:
        with suppress(OSError):
            os.write(2, f'{_sentence()}\n'.encode(errors='backslashreplace'))
    os._exit(interrupted())


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handler of signals: a KeyboardInterrupt, or the end where nothing is to be put in order."""
    if not _working:
        quit_now()
    if _holding or _imports(frame):
        later(RETRY, os.kill, os.getpid(), number)
    else:
        notice()
        raise KeyboardInterrupt


def notice() -> None:
    """Report that a signal was received, and that the end will follow."""
    global _noticed  # noqa: PLW0603
    _noticed = time.monotonic()


def allow(patience: float = PATIENCE) -> None:
    """Allow the main thread a time [s] to handle a signal: it has what should not be cut off."""
    global _patience  # noqa: PLW0603
    _patience = patience


def _bound(reader: int) -> None:
    """End where the main thread does not take in a signal: compiling an integrator takes long."""
    while True:
        # Only a thread that runs takes the byte out: who looks from outside sees that one does.
        select.select([reader], [], [])
        if not {*os.read(reader, 64)} & {*SIGNALS}:
            continue  # others that somebody handles end nothing
        patience = _patience
        earliest = time.monotonic() - patience
        time.sleep(patience)
        if _noticed < earliest:
            quit_now()


def _imports(frame: FrameType | None) -> bool:
    """True while a module is being imported: some make another error of a KeyboardInterrupt."""
    while frame is not None:
        if frame.f_code.co_filename.startswith('<frozen importlib'):
            return True
        frame = frame.f_back
    return False


def later(delay: float, call: Callable[..., object], *arguments: object) -> None:
    """Call after some time [s], in another thread, unless this process ends before."""
    timer = Timer(delay, call, arguments)
    timer.daemon = True
    timer.start()


def _unraisable(found: sys.UnraisableHookArgs) -> None:
    """A KeyboardInterrupt where Python can only complain, such as in a finaliser, comes again."""
    if isinstance(found.exc_value, KeyboardInterrupt):
        later(RETRY, os.kill, os.getpid(), signal.SIGINT)
    else:
        sys.__unraisablehook__(found)


def _ignore() -> None:
    """All is done and said."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
