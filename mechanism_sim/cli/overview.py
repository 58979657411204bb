"""Help of the command line: the first screen, and all commands by purpose."""

from __future__ import annotations

from typing import Any

from mechanism_sim.catalogue import scene_names
from mechanism_sim.errors import nearest
from mechanism_sim.nodes.arguments import Parser
from mechanism_sim.recording.runs import BAG_ENDINGS

GROUPS = {
    'A machine': ('new', 'import', 'edit', 'scenes', 'check', 'quantities'),
    'Run it': ('solve', 'run'),
    'Look at it': ('draw', 'cycle', 'animate', 'report', 'plot', 'view'),
    'How it vibrates': ('modes', 'response'),
    'Recorded runs': ('analyze', 'bag'),
    'Many runs': ('sweep', 'find', 'statistics', 'bifurcation', 'life'),
    'For other programs': ('export',),
}
"""All commands by purpose, in the order in which `--help` lists them."""

UNLISTED = 'node', 'thesis', 'basins', 'lyapunov'
"""Commands without a place in `--help`: launch files start nodes, one source has a thesis, and
options of `bifurcation` and `statistics` do what the others do."""

VERBS = {
    'bag': 'list or publish the contents of a bag, or recover one whose recorder was killed',
    'thesis': "the thesis's experiment, criteria of contact loss, and start angles",
}
"""Commands that consist of others, as `thesis starts`."""

RENAMED: dict[str, str] = {
    'bench': 'python -m benchmarks',
    'completion': 'mechanism-sim --completion',
    'equations': 'mechanism-sim check --equations',
    'identify': 'mechanism-sim analyze --fit',
    'info': 'mechanism-sim bag info',
    'layout': 'mechanism-sim export --format foxglove|rviz',
    'lift-off': 'mechanism-sim find --lift-off',
    'periodic': 'mechanism-sim find --periodic',
    'profile': 'mechanism-sim draw --profile',
    'recover': 'mechanism-sim bag recover',
    'sound': 'mechanism-sim animate -o FILE.wav',
    'teeth': 'mechanism-sim find --teeth',
    **{verb: f'mechanism-sim thesis {verb}' for verb in ('contact-loss', 'experiment', 'starts')},
    **{group: f'zros {group}' for group in ('topic', 'param', 'service', 'action')},
}
"""Names that commands had, and what is to be typed instead, beginning with the program."""

START = (
    ('Run a machine whose bearing rattles', ('solve four_bar_clearance --revolutions 10',)),
    (
        'Record a run, see what happened in it, and watch it in a browser',
        (
            'run four_bar_clearance --revolutions 10 --record run.mcap',
            'analyze run.mcap',
            'report run.mcap -o run.html',
        ),
    ),
    ('Change its speed and its clearance while it runs', ('view four_bar_clearance --open',)),
    (
        'Make a machine of your own',
        (
            'new my_machine --from four_bar',
            'check my_machine.yaml',
            'draw my_machine.yaml -o my_machine.svg',
        ),
    ),
    ('More', ('scenes', '--help')),
)
"""Proposals of the first screen: purposes, and the arguments of commands."""


def render_start() -> str:
    """The first screen: next steps, with commands to copy."""
    lines = ['mechanism-sim simulates planar machines with clearance, impacts and vibration.']
    for purpose, commands in START:
        lines += ['', f'{purpose}:', *(f'  mechanism-sim {command}' for command in commands)]
    lines += ['', "Help of a command: 'mechanism-sim solve --help'."]
    return '\n'.join(lines)


class Overview(Parser):
    """The parser of the whole command line, whose help lists the commands by purpose."""

    def format_help(self) -> str:
        """All commands, each with one line."""
        texts = {a.dest: a.help or '' for a in self.commands()._choices_actions}
        width = max(map(len, (*texts, '--completion')))
        lines = ['usage: mechanism-sim COMMAND ...', '', str(self.description)]
        for purpose, names in GROUPS.items():
            here = [name for name in names if name in texts]
            lines += ['', f'{purpose}:', *(f'  {name:{width}}  {texts[name]}' for name in here)]
        lines += [
            '',
            'Options:',
            f'  {"--help":{width}}  print this list; after the name of a command, its options',
            f'  {"--version":{width}}  print the version',
            f'  {"--completion":{width}}  SHELL: print its script for completion of names',
            '',
            "'mechanism-sim' alone shows how to begin.",
        ]
        return '\n'.join(lines) + '\n'

    def _check_value(self, action: Any, value: Any) -> None:
        """Refuse a command that does not exist, and name the nearest."""
        known = list(action.choices or ())
        if action.dest != 'command' or value in known:
            super()._check_value(action, value)
            return
        if value in RENAMED:
            self.error(f"'{value}' is now '{RENAMED[value]}'")
        if value in scene_names() or str(value).endswith(('.yaml', '.yml')):
            self.error(
                f"'{value}' is a scene, not a command: try 'mechanism-sim check {value}' or "
                f"'mechanism-sim solve {value}'"
            )
        if str(value).endswith(BAG_ENDINGS):
            self.error(f"'{value}' is a bag, not a command: try 'mechanism-sim analyze {value}'")
        self.error(f"there is no command '{value}'{nearest(value, known)}; --help lists them")

    def commands(self) -> Any:
        """Action of argparse that holds the commands; its `choices` are their parsers by name."""
        assert self._subparsers is not None  # noqa: S101 - `make_parser` has added them
        return self._subparsers._group_actions[0]

    def leaves(self) -> dict[str, Any]:
        """Parsers of all executable commands by their words, as `thesis starts`."""
        found: dict[str, Any] = {}
        for name, sub in self.commands().choices.items():
            of = sub._subparsers._group_actions[0].choices if name in VERBS else {'': sub}
            found |= {f'{name} {verb}'.strip(): leaf for verb, leaf in of.items()}
        return found
