"""Operating a run from outside, by the services of its nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mechanism_sim.messages import MessageError, message_class, service_class
from mechanism_sim.nodes.middleware import Client, Node, Parameter, ReentrantCallbackGroup
from mechanism_sim.nodes.scene_values import OVERRIDES, Content, lines_of
from mechanism_sim.nodes.services import SIMULATION
from mechanism_sim.pages.controls import DRIVE, Control

PLAYING, PAUSED = 1, 2
"""States as in simulation_interfaces/msg/SimulationState."""
_DONE, _ALREADY = 1, 101


class Operator:
    """Asks the nodes of a run; what they refuse is given back as a sentence, else nothing.

    Without the package `simulation_interfaces` of ROS, or without a service, that is the sentence.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._group = node, ReentrantCallbackGroup()
        self._clients: dict[tuple[str, str], Client] = {}

    async def state(self) -> int | None:
        """Playing, paused or stopped (0); None if unknown."""
        answer = await self._call(f'{SIMULATION}/srv/GetSimulationState', 'get_simulation_state')
        return None if isinstance(answer, str) else int(answer.state.state)

    async def begun(self) -> bool:
        """False if it is known that there is no motion of the run yet."""
        kind = f'{SIMULATION}/srv/GetEntitiesStates'
        answer = await self._call(kind, 'get_entities_states')
        return isinstance(answer, str) or answer.result.result == _DONE

    async def go(self, state: int) -> str:
        """Play or pause."""
        try:
            kind = message_class(f'{SIMULATION}/msg/SimulationState')
        except MessageError as error:
            return str(error)
        return _outcome(await self._call(
            f'{SIMULATION}/srv/SetSimulationState', 'set_simulation_state', state=kind(state=state)
        ))  # fmt: skip

    async def step(self, steps: int) -> str:
        """Carry out a number of steps of a paused run."""
        kind = f'{SIMULATION}/srv/StepSimulation'
        return _outcome(await self._call(kind, 'step_simulation', steps=steps))

    async def reset(self) -> str:
        """Back to time 0."""
        return _outcome(await self._call(f'{SIMULATION}/srv/ResetSimulation', 'reset_simulation'))

    async def values(self, owner: str, names: Sequence[str]) -> list[Any]:
        """Values of parameters of a node; empty without an answer."""
        answer = await self._call(
            'rcl_interfaces/srv/GetParameters', f'{owner}/get_parameters', names=list(names)
        )
        if isinstance(answer, str) or len(answer.values) != len(names):
            return []
        kinds = {2: 'integer_value', 3: 'double_value', 4: 'string_value', 9: 'string_array_value'}
        return [getattr(v, kinds.get(int(v.type), 'bool_value')) for v in answer.values]

    async def set_now(self, control: Control, value: float) -> str:
        """Change what acts on the run that goes on, to a value in the control's unit."""
        return await self._set(control.owner, control.parameter, control.si(value))

    async def set_next(self, control: Control, value: float) -> str:
        """Change a value of the scene for the next run; all others stay as they are."""
        present = await self.values(DRIVE, [OVERRIDES])
        if not present:
            return f"'{DRIVE}' does not report the values of the scene with which it runs"
        others = [
            x
            for x in Content('', lines_of(present[0])).lines
            if x.partition('=')[0].strip() != control.path
        ]
        return await self._set(DRIVE, OVERRIDES, '\n'.join([*others, control.override(value)]))

    async def _set(self, owner: str, name: str, value: float | str) -> str:
        answer = await self._call(
            'rcl_interfaces/srv/SetParameters', f'{owner}/set_parameters',
            parameters=[Parameter(name, value=value).to_parameter_msg()],
        )  # fmt: skip
        if isinstance(answer, str):
            return answer
        if len(answer.results) != 1:
            return f"'{owner}' gave {len(answer.results)} results for one parameter"
        (result,) = answer.results
        return '' if result.successful else str(result.reason) or f'{name} was refused'

    async def _call(self, kind: str, name: str, **fields: Any) -> Any:
        """The answer of a service, or a sentence why there is none."""
        try:
            service = service_class(kind)
        except MessageError as error:
            return str(error)
        client = self._clients.get((kind, name))
        if client is None:
            client = self._node.create_client(service, name, callback_group=self._group)
            self._clients[kind, name] = client
        if not client.service_is_ready():
            return f"nobody serves '{name}'"
        return await client.call_async(service.Request(**fields))


def _outcome(answer: Any) -> str:
    if isinstance(answer, str):
        return answer
    result = answer.result
    return '' if result.result in (_DONE, _ALREADY) else str(result.error_message)
