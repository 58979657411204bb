"""Arguments of a command line: those of this program, and those for ROS."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from mechanism_sim.errors import InputError, nearest

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


class _Formatter(argparse.HelpFormatter):
    """Help formatter that states informative defaults only."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.default in (None, False, '', []) or action.default is argparse.SUPPRESS:
            return action.help
        return f'{action.help} (default: %(default)s)'


class Once(argparse.Action):
    """Action that stores the value of an option and refuses a second one.

    Repeatable options have ``action='append'`` or ``'extend'``.
    """

    _filled: argparse.Namespace | None = None  # namespace of the last command line read

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Store a value.

        Raises
        ------
        argparse.ArgumentError
            If it has a value already.
        """
        if option_string is not None and self._filled is namespace:
            first = getattr(namespace, self.dest)
            raise argparse.ArgumentError(
                self, f"takes one value, but '{first}' and '{values}' are given"
            )
        self._filled = namespace
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """Parser with one-sentence errors that name the nearest existing word."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**more, allow_abbrev=False, formatter_class=_Formatter)
        for name in (None, 'store'):
            self.register('action', name, Once)

    def error(self, message: str) -> NoReturn:
        """Refuse the command line."""
        # without the terms of argparse
        for pattern, words in (
            (r'^argument ([^:]*): (?=takes one value)', r'\1 '),
            (r'^argument ([^:]*): ', r'\1: '),
            (r'invalid float value: (.*)', r'\1 is not a number'),
            (r'invalid int value: (.*)', r'\1 is not a whole number'),
            (r': expected one argument$', ' needs a value, after = if it begins with -'),
            (r': ignored explicit argument (.*)', r' takes no value, but \1 was given'),
            (r': expected at least one argument$', ' needs at least one value'),
            (r'the following arguments are required: (.*)', r'\1 is missing; see --help'),
            (r': not allowed with argument (.*)', r' and \1 exclude each other: keep one'),
        ):
            message = re.sub(pattern, words, message)
        # the command, if there are several
        _, _, command = self.prog.partition(' ')
        raise InputError(f'{command}: {message}' if command else message)

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help; argparse would ignore a full output."""
        (file or sys.stdout).write(self.format_help())

    def refuse(self, rest: Sequence[str]) -> NoReturn:
        """Refuse unknown arguments; raises `InputError`, as `error` does."""
        word, options = rest[0], self._option_string_actions
        name = word.partition('=')[0]
        if name.startswith('-'):
            known = nearest(name, [o for o in options if o.startswith('--')])
            self.error(f"there is no option '{name}'{known}; --help lists them")
        takes = [a.metavar or a.dest for a in self._get_positional_actions()]
        before = ', before all options' * any(
            a.nargs == '*' for a in self._get_positional_actions()
        )
        self.error(
            f"'{word}' is one argument too many: it takes "
            f'{" and ".join(map(str, takes)) or "options"}{before}; values with blanks need '
            "quotes, for example --set 'drive.speed=300 rpm'"
        )

    def is_given(self, options: argparse.Namespace, name: str) -> bool:
        """True if an option has another value than its default."""
        action = self._option_string_actions[f'--{name}']
        return bool(getattr(options, action.dest) != action.default)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            raise argparse.ArgumentError(
                action, f"'{value}' is not possible{nearest(str(value), known)}; allowed: "
                f'{", ".join(known)}',
            )  # fmt: skip


def split_ros_args(args: Sequence[str]) -> tuple[list[str], list[str]]:
    """Arguments of this program, and those for ROS: from ``--ros-args`` to ``--`` or the end."""
    own: list[str] = []
    ros: list[str] = []
    to: list[str] | None = None
    for arg in args:
        to = ros if arg == '--ros-args' else to
        (own if to is None else to).append(arg)
        to = None if arg == '--' else to
    return [arg for arg in own if arg != '--' or not ros], ros
