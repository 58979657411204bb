"""Quality of service: the profiles of rclpy as far as nodes use them."""

from dataclasses import dataclass
from enum import IntEnum

DEFAULT_DEPTH = 42  # what rmw_zenoh takes where nothing is said


class ReliabilityPolicy(IntEnum):
    """Reliability: samples arrive, or may be lost."""

    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(IntEnum):
    """Durability: a late subscription gets what was published before it, or not."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class HistoryPolicy(IntEnum):
    """Policy of a full queue: forget its oldest sample, or make the publisher wait."""

    KEEP_LAST = 1
    KEEP_ALL = 2


@dataclass(frozen=True)
class QoSProfile:
    """Quality of service of a publisher or subscription.

    ``depth`` counts samples; for KEEP_ALL it means nothing. ``lifespan`` is in nanoseconds, None
    for ever, and is told to others but not enforced.
    """

    depth: int = 0
    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    lifespan: int | None = None

    def __post_init__(self) -> None:
        if self.depth < 0:
            raise ValueError(f'The depth of a QoS profile is a count, not {self.depth}')
        if self.depth == 0:
            object.__setattr__(self, 'depth', DEFAULT_DEPTH)

    @property
    def blocks(self) -> bool:
        """True if a publisher waits for slow subscribers rather than lose a sample."""
        return (
            self.reliability == ReliabilityPolicy.RELIABLE
            and self.history == HistoryPolicy.KEEP_ALL
        )


qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = QoSProfile(depth=10)
qos_profile_parameters = QoSProfile(depth=1000)
qos_profile_rosout = QoSProfile(
    depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=10_000_000_000
)
qos_profile_action_status_default = QoSProfile(
    depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
qos_profile_clock = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def as_profile(qos: QoSProfile | int) -> QoSProfile:
    """Profile of the second or third argument of rclpy: a number is a depth."""
    return QoSProfile(depth=qos) if isinstance(qos, int) else qos
