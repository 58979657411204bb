"""Metadata of rosbag2 beside the messages: quality of service and the bag's own.

Source: rosbag2_storage, metadata version 9 (`yaml.hpp`, `qos.cpp`): policies by name, durations as
`{sec, nsec}`, one YAML document in the MCAP Metadata record `rosbag2`. A reader that does not find
the version there takes the policies for numbers.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import yaml

from mechanism_sim.errors import InputError

_METADATA_VERSION = 9
METADATA_NAME = 'rosbag2'
ENDLESS = {'sec': 9_223_372_036, 'nsec': 854_775_807}
_NO_TIME = 2**63 - 1  # starting time of a bag without messages

_POLICIES = {
    'reliability': ('reliable', 'best_effort'),
    'durability': ('volatile', 'transient_local'),
    'history': ('keep_last', 'keep_all'),
}


class QosLike(Protocol):
    """Anything with the policies of `Qos`."""

    @property
    def reliability(self) -> str:
        """'reliable' or 'best_effort'."""

    @property
    def durability(self) -> str:
        """'volatile' or 'transient_local'."""

    @property
    def history(self) -> str:
        """'keep_last' or 'keep_all'."""

    @property
    def depth(self) -> int:
        """Number of messages that 'keep_last' keeps."""


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic, named as by `QosLike`; defaults of ROS 2."""

    reliability: str = 'reliable'
    durability: str = 'volatile'
    history: str = 'keep_last'
    depth: int = 10


@dataclass(frozen=True)
class TopicRecord:
    """A topic as the metadata lists it: `qos` is the profile made by `qos_profile`."""

    name: str
    type: str
    type_hash: str
    qos: dict[str, Any]
    count: int


def qos_profile(qos: QosLike) -> dict[str, Any]:
    """Return the profile of `qos` as rosbag2 writes it. InputError: a policy it does not know."""
    named = {policy: str(getattr(qos, policy)) for policy in _POLICIES}
    for policy, value in named.items():
        if value not in _POLICIES[policy]:
            known = ', '.join(_POLICIES[policy])
            raise InputError(f'quality of service: {policy} {value!r} is none of {known}.')
    return {
        'history': named['history'],
        'depth': int(qos.depth),
        'reliability': named['reliability'],
        'durability': named['durability'],
        'deadline': ENDLESS,
        'lifespan': ENDLESS,
        'liveliness': 'automatic',
        'liveliness_lease_duration': ENDLESS,
        'avoid_ros_namespace_conventions': False,
    }


def bag_metadata(file: str, start: int, end: int, topics: Iterable[TopicRecord]) -> str:
    """Return the `serialized_metadata` of a bag of one file.

    Parameters
    ----------
    file : name of the file
    start : log time of the first message [ns]
    end : log time of the last message [ns]; before `start` where there is none
    topics : the topics with what was written on each
    """
    topics = tuple(topics)
    count = sum(topic.count for topic in topics)
    extent = {
        'starting_time': {'nanoseconds_since_epoch': start if count else _NO_TIME},
        'duration': {'nanoseconds': end - start if count else 0},
        'message_count': count,
    }
    document = {
        'version': _METADATA_VERSION,
        'storage_identifier': 'mcap',
        'relative_file_paths': [file],
        **extent,
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [topic.qos],
                    'type_description_hash': topic.type_hash,
                },
                'message_count': topic.count,
            }
            for topic in topics
        ],
        # Of messages or whole files; how MCAP compresses its chunks is its own business.
        'compression_format': '',
        'compression_mode': '',
        'files': [{'path': file, **extent}],
        'custom_data': None,
        'ros_distro': os.environ.get('ROS_DISTRO', ''),
    }
    return plain_yaml(document)


def plain_yaml(document: Any) -> str:
    """Return `document` as YAML in block style, without anchors, keys in the order given."""
    return yaml.dump(document, Dumper=_PlainDumper, sort_keys=False)


class _PlainDumper(yaml.SafeDumper):
    """Repeats what occurs twice instead of referring to it: not every reader resolves aliases."""

    def ignore_aliases(self, _data: Any) -> bool:
        return True
