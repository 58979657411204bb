"""Definitions of messages, services and actions, their text and their hash.

The definitions of ROS 2 Jazzy come with rosbags; those of other packages are read from their
folders ``msg/``, see `definition_folder`. The hash is RIHS01 of REP-2016.
"""

import os
import re
import sys
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from typing import Any

import yaml
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ros_interfaces import simulation
from ros_interfaces.services import SERVICES

RULER = '=' * 80

_NAMES = {
    'action_msgs/msg': 'GoalInfo GoalStatus GoalStatusArray',
    'builtin_interfaces/msg': 'Duration Time',
    'diagnostic_msgs/msg': 'DiagnosticArray DiagnosticStatus KeyValue',
    'geometry_msgs/msg': 'Accel Point Pose PoseStamped Quaternion Transform TransformStamped'
    ' Twist Vector3 Wrench WrenchStamped',
    'rcl_interfaces/msg': 'FloatingPointRange IntegerRange ListParametersResult Log Parameter'
    ' ParameterDescriptor ParameterEvent ParameterType ParameterValue SetParametersResult',
    'lifecycle_msgs/msg': 'State Transition TransitionDescription TransitionEvent',
    'rosgraph_msgs/msg': 'Clock',
    'sensor_msgs/msg': 'Imu JointState',
    'simulation_interfaces/msg': 'Bounds EntityCategory EntityFilters EntityInfo EntityState'
    ' Resource Result SimulationState SimulatorFeatures SpawnResult Spawnable TagsFilter'
    ' WorldResource',
    'std_msgs/msg': 'ColorRGBA Float64 Header String',
    'tf2_msgs/msg': 'TFMessage',
    'unique_identifier_msgs/msg': 'UUID',
    'visualization_msgs/msg': 'Marker MarkerArray',
    'action_msgs/srv': 'CancelGoal',
    'lifecycle_msgs/srv': 'ChangeState GetAvailableStates GetAvailableTransitions GetState',
    'rcl_interfaces/srv': 'DescribeParameters GetParameterTypes GetParameters ListParameters'
    ' SetParameters SetParametersAtomically',
    'simulation_interfaces/srv': 'DeleteEntity GetAvailableWorlds GetCurrentWorld GetEntities'
    ' GetEntitiesStates GetSpawnables SpawnEntities SpawnEntity'
    ' GetEntityInfo GetEntityState GetSimulationState GetSimulatorFeatures LoadWorld'
    ' ResetSimulation SetEntityState SetSimulationState StepSimulation',
    'std_srvs/srv': 'Trigger',
    'simulation_interfaces/action': 'SimulateSteps',
}
PUBLIC = {name: package for package, names in _NAMES.items() for name in names.split()}

# The definitions that come with rosbags have lost their explicit defaults; this is the only one
# of the packages above.
_DEFAULTS: dict[str, dict[str, Any]] = {'geometry_msgs/msg/Quaternion': {'w': 1.0}}
_TEXTS: dict[str, str] = {}
# Threads ask for definitions: one that is known has its text and its defaults, too.
_LEARNING = RLock()
# What follows the name of a field is its default, in YAML but for constants ('=').
_DEFAULT_LINE = re.compile(r'^\s*[\w/]+(?:<=\d+)?(?:\[[<=\d]*\])?\s+(\w+)\s+([^=\s#].*)$')

# What actions and services are made of.
_PART = re.compile(
    r'(_(SendGoal|GetResult))?_(Request|Response|Goal|Result|Feedback(Message)?)$'
    r'|_(SendGoal|GetResult)$'
)


class MessageError(ValueError):
    """A message is unknown, does not match its definition, or cannot be decoded."""


def type_name(cls: type[Any]) -> str:
    """``pkg/msg/Name``, ``pkg/srv/Name`` or ``pkg/action/Name`` of a class."""
    for mark in ('__msgtype__', '__srvtype__', '__actiontype__'):
        if (name := getattr(cls, mark, None)) is not None:
            return str(name)
    package, kind, *_ = [*cls.__module__.split('.'), '']
    if kind not in {'msg', 'srv', 'action'}:
        raise MessageError(f'{cls.__name__} is not a class of a message or service')
    return f'{package}/{kind}/{cls.__name__}'


def definition_folder(package: str) -> Path | None:
    """Folder of the definitions ``*.msg`` of a package; None if there is none.

    Beside its Python package in a source tree, or ``share/PACKAGE/msg`` of a prefix, where pip,
    colcon and ROS put them. The package is not imported.
    """
    shared = Path('share', package, 'msg')
    prefixes = [Path(sys.prefix)]
    prefixes += [Path(p) for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    candidates = [prefix / shared for prefix in prefixes]
    spec = find_spec(package) if package.isidentifier() else None
    if spec is not None and spec.submodule_search_locations:
        sources = Path(spec.submodule_search_locations[0]).resolve()
        candidates[:0] = [sources.parent / 'msg', *(root / shared for root in sources.parents)]
    return next((folder for folder in candidates if any(folder.glob('*.msg'))), None)


@cache
def messages_of(package: str) -> tuple[str, ...]:
    """Names of the messages that the folder of a package defines, in alphabetical order."""
    folder = definition_folder(package)
    return () if folder is None else tuple(sorted(path.stem for path in folder.glob('*.msg')))


@cache
def typestore() -> Typestore:
    """Every definition known: those of ROS 2 Jazzy, and others once they are asked for."""
    store = get_typestore(Stores.ROS2_JAZZY)
    # ROS treats char as uint8, also when it hashes; rosbags hashes it as a type of its own, which
    # would spoil every service hash through ServiceEventInfo.client_gid.
    for name, (constants, members) in store.fielddefs.items():
        fields = [(field, _char_as_uint8(description)) for field, description in members]
        store.fielddefs[name] = (constants, fields)
    return store


def define(name: str, text: str) -> None:
    """Add the message ``pkg/msg/Name`` given by the text of its definition."""
    with _LEARNING:
        _register(name, text)


def define_service(name: str, text: str) -> None:
    """Add the service ``pkg/srv/Name`` given by the text of its definition."""
    with _LEARNING:
        _register_service(name, text)


def define_action(name: str, text: str) -> None:
    """Add the action ``pkg/action/Name`` given by the text of its definition."""
    with _LEARNING:
        _register_action(name, text)


def definition(name: str) -> str:
    """MCAP schema text (``ros2msg``): the definition, then every nested one under its ruler."""
    _check_name(name)
    texts = [_text(name)]
    texts += [f'{RULER}\nMSG: {_short(nested)}\n{_text(nested)}' for nested in _dependencies(name)]
    return ''.join(texts)


@cache
def type_hash(name: str) -> str:
    """``RIHS01_<sha256>`` of a message or a service."""
    _check_name(name)
    _dependencies(name)  # which takes them in
    return typestore().hash_rihs01(name)


def service_type_hash(name: str) -> str:
    """``RIHS01_<sha256>`` of a service: the one hash its keys carry."""
    return type_hash(name)


def defaults(name: str) -> Mapping[str, Any]:
    """Explicit defaults of the fields of a message, by field."""
    return _DEFAULTS.get(name, {})


def field_descriptions(name: str) -> list[tuple[str, Any]]:
    """Fields of a message as rosbags describes them: name, and (node type, what it holds)."""
    _check_name(name)
    return list(typestore().fielddefs[name][1])


def _check_name(name: str) -> None:
    with _LEARNING:
        if name not in typestore().fielddefs:
            _learn(name)
        if name in typestore().fielddefs:
            return
        learned = [*typestore().fielddefs]
    whole = _PART.sub('', name)
    known = {_PART.sub('', other) for other in learned}
    known |= {other for texts, _ in _OWN for other in texts}
    package = whole.partition('/')[0]
    known |= {f'{package}/msg/{short}' for short in messages_of(package)}
    (close,) = get_close_matches(whole, known, 1, 0.8) or ('',)
    hint = 'types are written as std_msgs/msg/String'
    if close:
        hint = f"did you mean '{close}'?"
    elif whole.count('/') == 2:
        folder = whole.rpartition('/')[0]
        hint = f'definitions are looked for in share/{folder} of AMENT_PREFIX_PATH'
    raise MessageError(f"the type '{whole}' is unknown; {hint}")


def _learn(name: str) -> None:
    """Take in a definition: of its own text, or of that of the service or action it belongs to."""
    package, kind, short = [*name.split('/'), '', ''][:3]
    whole = f'{package}/{kind}/{short.partition("_")[0]}'
    for texts, register in _OWN:
        if whole in texts:
            return register(whole, texts[whole])
    folder = definition_folder(package)
    if folder is not None and kind == 'msg' and short in messages_of(package):
        _register(name, (folder / f'{short}.msg').read_text())
    return None


def _register(name: str, text: str) -> None:
    package, _, short = name.split('/')
    parsed = get_types_from_msg(text, f'{package}/msg/{short}')
    # not by rosbags' own `register`, which compiles a class that nobody uses
    _keep(name, parsed[f'{package}/msg/{short}'])
    _TEXTS[name] = text.rstrip() + '\n'
    matches = map(_DEFAULT_LINE.match, text.splitlines())
    _DEFAULTS[name] = {found[1]: yaml.safe_load(found[2]) for found in matches if found}


_FILLER: list[Any] = [('structure_needs_at_least_one_member', (Nodetype.BASE, ('uint8', 0)))]


def _keep(name: str, found: Any) -> None:
    constants, fields = found[0], [(n, _char_as_uint8(x)) for n, x in found[1] or _FILLER]
    if typestore().fielddefs.setdefault(name, (constants, fields))[1] != fields:
        raise MessageError(f'{name!r} is defined otherwise already')


def _register_service(name: str, text: str) -> None:
    request, response = text.split('---\n') if '---\n' in text else (text, '')
    _register(f'{name}_Request', request)
    _register(f'{name}_Response', response)
    parts: dict[str, Any] = {
        part: (Nodetype.NAME, f'{name}_{part.capitalize()}') for part in _PARTS
    }
    event: list[tuple[str, Any]] = [('info', (Nodetype.NAME, 'service_msgs/msg/ServiceEventInfo'))]
    event += [(part, (Nodetype.SEQUENCE, (parts[part], 1))) for part in _PARTS[:2]]
    _keep(f'{name}_Event', ([], event))
    _keep(name, ([], [(f'{part}_message', parts[part]) for part in _PARTS]))


def _register_action(name: str, text: str) -> None:
    """An action and what is derived of it, as rosidl does (``rosidl_parser/definition.py``)."""
    for part, body in zip(('Goal', 'Result', 'Feedback'), text.split('---\n'), strict=True):
        _register(f'{name}_{part}', body)
    goal_id = 'unique_identifier_msgs/UUID goal_id\n'
    _register_service(
        f'{name}_SendGoal',
        f'{goal_id}{name}_Goal goal\n---\nbool accepted\nbuiltin_interfaces/Time stamp\n',
    )
    _register_service(f'{name}_GetResult', f'{goal_id}---\nint8 status\n{name}_Result result\n')
    _register(f'{name}_FeedbackMessage', f'{goal_id}{name}_Feedback feedback\n')
    members = {
        'goal': 'Goal',
        'result': 'Result',
        'feedback': 'Feedback',
        'send_goal_service': 'SendGoal',
        'get_result_service': 'GetResult',
        'feedback_message': 'FeedbackMessage',
    }
    fields: list[tuple[str, Any]] = [
        (field, (Nodetype.NAME, f'{name}_{part}')) for field, part in members.items()
    ]
    _keep(name, ([], fields))


_PARTS = ('request', 'response', 'event')
_OWN = (
    (simulation.MESSAGES, _register),
    (SERVICES, _register_service),
    (simulation.SERVICES, _register_service),
    (simulation.ACTIONS, _register_action),
)
"""Definitions that rosbags lacks, and what takes them in."""


def _char_as_uint8(description: Any) -> Any:
    kind, inner = description
    if kind == Nodetype.BASE:
        return (kind, ('uint8', 0)) if inner[0] == 'char' else description
    if kind == Nodetype.NAME:
        return description
    return (kind, (_char_as_uint8(inner[0]), inner[1]))


def _dependencies(name: str) -> list[str]:
    """Every type below a type, in the order in which they are met, each once."""

    def walk(parent: str) -> Iterator[str]:
        for _, (kind, inner) in field_descriptions(parent):
            child = inner[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, inner)
            if child[0] == Nodetype.NAME:
                yield child[1]
                yield from walk(child[1])

    return list(dict.fromkeys(walk(name)))


def _short(name: str) -> str:
    return name.replace('/msg/', '/')


def _text(name: str) -> str:
    if name not in _TEXTS:
        text, _ = typestore().generate_msgdef(name, ros_version=2)
        _TEXTS[name] = text.split(RULER)[0].rstrip() + '\n'
    return _TEXTS[name]
