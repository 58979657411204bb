"""Quality of service of the topics: what carries results is never dropped."""

from __future__ import annotations

from mechanism_sim.messages.topics import Delivery
from mechanism_sim.nodes.middleware import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

#: Results: the publisher waits for slow subscribers, nothing is lost.
RESULTS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE, depth=1000
)

#: Descriptions: whoever comes late gets the last one.
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

#: The clock: only the newest matters.
CLOCK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)

#: The clock for who records it: not only the newest of what came while it was busy.
CLOCK_HEARD = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT
)

#: by the delivery of a topic
PROFILES: dict[Delivery, QoSProfile] = {'results': RESULTS, 'latched': LATCHED, 'clock': CLOCK}
