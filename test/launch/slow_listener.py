"""Counts what a run publishes, and says so once all of it is here or nothing comes any more."""

import json
import time

import rclpy
from mechanism_sim.msg import (
    Impact,
    JointReactions,
    LinkageState,
    ModeChange,
    Motion,
    Progress,
    SceneChange,
)
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

QUIET = 15.0
"""[s] without any message after the end of the run: what is missing then is lost."""
TOPICS = {
    '/motion': Motion, '/impacts': Impact, '/mode_changes': ModeChange,
    '/scene_changes': SceneChange, '/joint_states': JointState, '/linkage_state': LinkageState,
    '/joint_reactions': JointReactions, '/tf': TFMessage,
}  # fmt: skip

rclpy.init()
node = rclpy.create_node('slow_listener')
qos = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
heard, announced, last = dict.fromkeys(TOPICS, 0), {}, [time.monotonic()]


def count(topic):
    """Make a callback that counts the messages of a topic."""

    def take(_):
        heard[topic] += 1
        last[0] = time.monotonic()
        if topic == '/motion' and heard[topic] == 5:
            print('UNDER WAY', flush=True)

    return take


def note(report):
    """Take what the integrator has published from the report of its end."""
    if report.node == 'linkage' and report.finished:
        counts = dict(zip(report.topics, map(int, report.counts), strict=True))
        announced.update({topic: counts.get(topic, 0) for topic in TOPICS})


for name, kind in TOPICS.items():
    node.create_subscription(kind, name, count(name), qos)
node.create_subscription(Progress, '/progress', note, qos)
while heard != announced and not (announced and time.monotonic() > last[0] + QUIET):
    rclpy.spin_once(node, timeout_sec=0.5)
print('COUNTS ' + json.dumps({'heard': heard, 'announced': announced}), flush=True)
