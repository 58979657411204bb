"""Values of a scene, and their changes between two runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.nodes.described_node import DescribedNode
from mechanism_sim.nodes.middleware import Parameter
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.validation import validate

SCENE, OVERRIDES = 'scene', 'overrides'
"""Names of the parameters that say which machine it is."""


class Content(NamedTuple):
    """Machine of a node's runs, by its parameters ``scene`` and ``overrides``."""

    scene: str
    overrides: str

    @staticmethod
    def declare(node: DescribedNode) -> Content:
        """Declare the parameters; returns their content."""
        when = 'from the next reset on; set that of crank_drive'
        about = f'Name of a scene of the package, or path of a file; {when}'
        node.declare(SCENE, 'four_bar_clearance', about)
        node.declare_list(OVERRIDES, f'PATH=VALUE each; in one text, one a line; {when}')
        return Content.of(node)

    @staticmethod
    def of(node: DescribedNode) -> Content:
        """The content of a node's parameters."""
        return Content(node.value(SCENE), lines_of(node.value(OVERRIDES)))

    def changed(self, parameters: Sequence[Parameter]) -> Content:
        """Content with changed values, if they are texts; the node refuses others."""
        given = {p.name: lines_of(p.value) for p in parameters if p.name in (SCENE, OVERRIDES)}
        return Content(given.get(SCENE, self.scene), given.get(OVERRIDES, self.overrides))

    def parameters(self) -> list[Parameter]:
        """The parameters with these values."""
        return [Parameter(n, value=x) for n, x in zip((SCENE, OVERRIDES), self, strict=True)]

    @property
    def lines(self) -> list[str]:
        """The overrides, each ``PATH=VALUE``."""
        return [line for line in self.overrides.splitlines() if line.strip()]

    def load(self) -> Machine:
        """The machine; raises InputError if the scene is not valid."""
        return validate(load_scene(self.scene, self.lines))


def lines_of(value: object) -> str:
    """Lines of a parameter that is a text or an array of texts; empty if it is neither."""
    texts = [value] if isinstance(value, str) else value if isinstance(value, list | tuple) else []
    return '\n'.join(text for text in texts if isinstance(text, str))


def next_machine(present: Machine, asked: Content) -> Machine:
    """The machine of another scene, or with other overrides, for nodes that have run `present`."""
    machine = asked.load()
    before, after = _structure(present), _structure(machine)
    for what, now in before.items():
        if after[what] != now:
            raise InputError(
                f'{machine.name}: {what} cannot change from one run to the next (now '
                f'{_join(now)}; asked for {_join(after[what])}): end this run and start '
                'another'
            )
    return machine


def _structure(machine: Machine) -> dict[str, list[str]]:
    """Names on which nodes and messages of a run depend, causes first."""
    plan, mechanism, scene = machine.plan, machine.mechanism, machine.scene
    commands = machine.drive.commands
    return {
        'the joints with clearance': [*machine.plan.clearances],
        'the gaps': [*machine.physics.clearances],
        'the joints with restitution': [n for n, p in plan.rigid.items() if p.wall == 'rigid'],
        'the kinds of drives': [f'{c}: {type(laws[0]).__name__}' for c, laws in plan.laws.items()],
        'the commands to the drive': [f'up to {commands.fastest:g} rad/s'] if commands else [],
        'the sensors': [
            f'{name} ({s.kind}{", imu" * s.imu})' for name, s in scene.sensors.items()
        ],
        'the frames on springs': [*scene.oscillators],
        'the joints': [f'{j.name} ({type(j).__name__})' for j in mechanism.joints],
        'the joints that close loops': [*mechanism.cut],
        'the coordinates': [*mechanism.coordinates],
        'the displacements among the coordinates': [*mechanism.displacements],
    }


def _join(names: list[str]) -> str:
    return ', '.join(names) or 'none'
