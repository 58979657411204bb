"""Scenes as worlds of `simulation_interfaces`: which there are, which runs, and to load one."""

from __future__ import annotations

from typing import Any

from mechanism_sim.catalogue import scene_names
from mechanism_sim.errors import InputError
from mechanism_sim.messages import message_class, service_class
from mechanism_sim.nodes.control import SimulationControl
from mechanism_sim.nodes.drive import Drive
from mechanism_sim.nodes.middleware import Parameter, ReentrantCallbackGroup
from mechanism_sim.nodes.scene_values import OVERRIDES, SCENE, Content, next_machine

PACKAGE = 'simulation_interfaces'
# LoadWorld.Response
UNSUPPORTED_FORMAT, NO_RESOURCE, RESOURCE_PARSE_ERROR, UNSUPPORTED_ELEMENTS = 101, 102, 103, 106


class Worlds:
    """Serves the scenes; one can be loaded that the nodes of the run can go on with.

    It then holds from time 0 of a new run, which begins stopped.
    """

    def __init__(self, drive: Drive, control: SimulationControl) -> None:
        self._drive, self._control = drive, control
        self._result = message_class(f'{PACKAGE}/msg/Result')
        self._world = message_class(f'{PACKAGE}/msg/WorldResource')
        group = ReentrantCallbackGroup()
        for short, name, answer in (
            ('GetAvailableWorlds', 'get_available_worlds', self._list),
            ('GetCurrentWorld', 'get_current_world', self._report),
            ('LoadWorld', 'load_world', self._load),
        ):
            kind = service_class(f'{PACKAGE}/srv/{short}')
            drive.create_service(kind, name, answer, callback_group=group)

    def _list(self, request: Any, response: Any) -> Any:
        if request.filter.tags:
            reason = 'scenes have no tags: leave the filter empty'
            return self._answer(response, reason, self._result.RESULT_FEATURE_UNSUPPORTED)
        response.worlds = [self._describe(name) for name in scene_names()]
        return self._answer(response, '')

    def _report(self, _request: Any, response: Any) -> Any:
        response.world = self._describe(self._drive.value(SCENE), self._drive.machine.name)
        return self._answer(response, '')

    async def _load(self, request: Any, response: Any) -> Any:
        drive, control, uri = self._drive, self._control, request.uri.removeprefix('file://')
        if not uri:
            code = UNSUPPORTED_FORMAT if request.resource_string else NO_RESOURCE
            reason = 'uri must be the name of a scene or the path of a YAML file'
            return self._answer(response, reason, code)
        if reason := control.refusal():
            return self._answer(response, reason)
        asked = Content(uri, '')
        try:
            asked.load()
        except InputError as error:
            return self._answer(response, str(error), RESOURCE_PARSE_ERROR)
        try:
            next_machine(drive.machine, asked)
        except InputError as error:
            return self._answer(response, str(error), UNSUPPORTED_ELEMENTS)
        before = Content.of(drive)
        self._set(asked)
        drive.pause()
        if reason := await control.alone('loading a scene', drive.start_over()):
            self._set(before)
            return self._answer(response, reason)
        control.stopped = True
        response.world = self._describe(uri, drive.machine.name)
        return self._answer(response, '')

    def _set(self, content: Content) -> None:
        values = zip((SCENE, OVERRIDES), content, strict=True)
        self._drive.set_parameters_atomically([Parameter(n, value=x) for n, x in values])

    def _describe(self, uri: str, name: str = '') -> Any:
        world = self._world(name=name or uri)
        world.world_resource.uri = uri
        return world

    def _answer(self, response: Any, reason: str, code: int | None = None) -> Any:
        return self._control.answer(response, reason, code)
