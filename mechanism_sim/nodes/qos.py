"""Quality of service of the topics: results are never dropped."""

from __future__ import annotations

from mechanism_sim.messages.topics import Delivery
from mechanism_sim.nodes.middleware import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from mechanism_sim.recording.rosbag2 import Qos

#: Results: the publisher waits for slow subscribers, no message is lost.
RESULTS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE, depth=1000
)

#: Descriptions: late subscribers get the last one.
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

#: The clock: only the newest message is kept.
CLOCK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)

#: For recording: all messages received while the recorder was busy, also of others on a topic.
HEARD: dict[Delivery, QoSProfile] = {
    'clock': QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT
    ),
    'latched': QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=100,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    ),
}

#: profiles by delivery of a topic
PROFILES: dict[Delivery, QoSProfile] = {'results': RESULTS, 'latched': LATCHED, 'clock': CLOCK}


def policies(profile: QoSProfile) -> Qos:
    """A profile in the form of a bag: its policies by name."""
    named = {x: getattr(profile, x).name.lower() for x in ('reliability', 'durability', 'history')}
    return Qos(**named, depth=profile.depth)


def profile_of(qos: Qos | None) -> QoSProfile:
    """The recorded profile of a topic of a bag; the usual one if unknown."""
    if qos is None:
        return QoSProfile(depth=10)
    words = {word.lower() for word in (qos.reliability, qos.durability, qos.history)}
    best_effort, latched = 'best_effort' in words, 'transient_local' in words
    return QoSProfile(
        depth=max(int(qos.depth), 1),
        history=HistoryPolicy.KEEP_ALL if 'keep_all' in words else HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
