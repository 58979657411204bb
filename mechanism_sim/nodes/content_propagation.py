"""The scene of the drive, handed to its partners between two runs."""

from __future__ import annotations

from typing import Any

from mechanism_sim.messages import service_class
from mechanism_sim.nodes.middleware import Client, Parameter, ReentrantCallbackGroup
from mechanism_sim.nodes.scene_values import OVERRIDES, SCENE, Content
from mechanism_sim.nodes.simulation_node import SimulationNode


class ContentPropagation:
    """Hands the drive's scene to its partners, before a run that has another than the last."""

    def __init__(self, drive: SimulationNode) -> None:
        self._drive, self._run_with = drive, Content.of(drive)
        self._kind = service_class('rcl_interfaces/srv/SetParametersAtomically')
        group = ReentrantCallbackGroup()  # who asks for a reset is in a callback that waits
        self._clients: dict[str, Client] = {
            name: drive.create_client(
                self._kind, f'{name}/set_parameters_atomically', callback_group=group
            )
            for name in drive.partners.names
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
