"""Values of a scene, and their change between two runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mechanism_sim.errors import InputError
from mechanism_sim.messages import service_class
from mechanism_sim.middleware import Client, Parameter, ReentrantCallbackGroup
from mechanism_sim.scene import Machine, load_scene
from mechanism_sim.scene.gate import admit

if TYPE_CHECKING:
    from mechanism_sim.nodes.crank_drive import CrankDrive

OVERRIDES = 'overrides'
"""The parameter: ``PATH=VALUE``, one a line."""


def lines(overrides: str) -> list[str]:
    """The ``PATH=VALUE`` of a text that has one a line."""
    return [line for line in overrides.splitlines() if line.strip()]


def next_machine(present: Machine, scene: str, overrides: str) -> Machine:
    """The machine of a scene with other overrides, for nodes that have run `present`.

    Raises
    ------
    InputError
        If the scene is not good, or has other coordinates, joints, drives, sensors or nodes: those
        that run could not go on with it.
    """
    machine = admit(load_scene(scene, lines(overrides)))
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
        'the joints with restitution': [n for n, p in plan.rigid.items() if p.contact is None],
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


class OverridePropagation:
    """Hands the drive's overrides to its partners, before a run that has others than the last."""

    def __init__(self, drive: CrankDrive) -> None:
        self._drive, self._run_with = drive, drive.value(OVERRIDES)
        self._kind = service_class('rcl_interfaces/srv/SetParameters')
        group = ReentrantCallbackGroup()  # who asks for a reset is in a callback that waits
        self._clients: dict[str, Client] = {
            name: drive.create_client(self._kind, f'{name}/set_parameters', callback_group=group)
            for name in drive.partners
        }
        drive.add_post_set_parameters_callback(self._announce)

    async def propagate(self) -> str:
        """Give all partners the values for the next run; why it cannot be, empty if it is done.

        If one refuses, all have those of the present run again.
        """
        asked = self._drive.value(OVERRIDES)
        if asked == self._run_with:
            return ''
        for n, (name, client) in enumerate(self._clients.items()):
            if reason := await self._set(client, asked):
                for _, earlier in list(self._clients.items())[:n]:
                    await self._set(earlier, self._run_with)
                return f"'{name}' cannot begin a run with other values of the scene: {reason}"
        self._run_with = asked
        return ''

    async def _set(self, client: Client, value: str) -> str:
        if not client.service_is_ready():
            return f'the service {client.service_name} is not available'
        parameter = Parameter(OVERRIDES, value=value).to_parameter_msg()
        answer: Any = await client.call_async(self._kind.Request(parameters=[parameter]))
        if len(answer.results) != 1:
            return f'{client.service_name} gave {len(answer.results)} results for one parameter'
        (result,) = answer.results
        return '' if result.successful else str(result.reason)

    def _announce(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == OVERRIDES:
                values = ', '.join(lines(parameter.value)) or 'none'
                self._drive.get_logger().info(f'overrides ({values}) hold from the next reset on')
