"""Values of a scene, and their change between two runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.messages import service_class
from mechanism_sim.nodes.middleware import Client, Parameter, ReentrantCallbackGroup
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.gate import admit

if TYPE_CHECKING:
    from mechanism_sim.nodes.crank_drive import CrankDrive
    from mechanism_sim.nodes.described_node import DescribedNode

SCENE, OVERRIDES = 'scene', 'overrides'
SCENE_PARAMETERS = (
    (SCENE, 'four_bar_clearance', 'Name of a scene of the package, or path of a file'),
    (OVERRIDES, '', 'PATH=VALUE each, one a line'),
)
"""Names of the parameters that say which machine it is, their defaults, and what they are."""


class Content(NamedTuple):
    """Which machine a node is to run: parameters ``scene`` and ``overrides``."""

    scene: str
    overrides: str

    @staticmethod
    def of(node: DescribedNode) -> Content:
        """What the parameters of a node say."""
        return Content(node.value(SCENE), node.value(OVERRIDES))

    def changed(self, parameters: Sequence[Parameter]) -> Content:
        """The same with other values of those that are texts; the middleware refuses others."""
        given = {p.name: p.value for p in parameters if isinstance(p.value, str)}
        return Content(given.get(SCENE, self.scene), given.get(OVERRIDES, self.overrides))

    @property
    def lines(self) -> list[str]:
        """The overrides, each ``PATH=VALUE``."""
        return [line for line in self.overrides.splitlines() if line.strip()]

    def load(self) -> Machine:
        """The machine; raises InputError if the scene is not good."""
        return admit(load_scene(self.scene, self.lines))


def next_machine(present: Machine, asked: Content) -> Machine:
    """The machine of another scene, or with other overrides, for nodes that have run `present`.

    Raises
    ------
    InputError
        If the scene is not good, or has other coordinates, joints, drives, sensors or nodes: those
        that run could not go on with it.
    """
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
    """What the nodes of a run are made for, and what their messages list; causes come first."""
    plan, mechanism, scene = machine.plan, machine.mechanism, machine.scene
    commands = machine.commands
    return {
        'the joints with clearance': [*machine.clearances],
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


class ContentPropagation:
    """Hands the drive's scene to its partners, before a run that has another than the last."""

    def __init__(self, drive: CrankDrive) -> None:
        self._drive, self._run_with = drive, Content.of(drive)
        self._kind = service_class('rcl_interfaces/srv/SetParametersAtomically')
        group = ReentrantCallbackGroup()  # who asks for a reset is in a callback that waits
        self._clients: dict[str, Client] = {
            name: drive.create_client(
                self._kind, f'{name}/set_parameters_atomically', callback_group=group
            )
            for name in drive.partners
        }
        drive.add_post_set_parameters_callback(self._announce)

    async def propagate(self) -> str:
        """Give all partners the values for the next run; why it cannot be, empty if it is done.

        If one refuses, all have those of the present run again.
        """
        asked = Content.of(self._drive)
        if asked == self._run_with:
            return ''
        for n, (name, client) in enumerate(self._clients.items()):
            if reason := await self._set(client, asked):
                for _, earlier in list(self._clients.items())[:n]:
                    await self._set(earlier, self._run_with)
                return f"'{name}' cannot begin a run with other values of the scene: {reason}"
        self._run_with = asked
        return ''

    async def _set(self, client: Client, content: Content) -> str:
        if not client.service_is_ready():
            return f'the service {client.service_name} is not available'
        values = zip((SCENE, OVERRIDES), content, strict=True)
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values]
        answer: Any = await client.call_async(self._kind.Request(parameters=parameters))
        return '' if answer.result.successful else str(answer.result.reason)

    def _announce(self, parameters: list[Parameter]) -> None:
        if {SCENE, OVERRIDES} & {parameter.name for parameter in parameters}:
            asked = Content.of(self._drive)
            values = ', '.join(asked.lines) or 'no overrides'
            self._drive.get_logger().info(f'{asked.scene} ({values}) holds from the next reset on')
