"""Prints the motion of the crank from `joint_states`, by eclipse-zenoh and rosbags alone."""

import json
import os
import time

import zenoh
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
router = os.environ.get('MECHANISM_SIM_ROUTER', 'tcp/127.0.0.1:7447')

config = zenoh.Config()
config.insert_json5('mode', '"client"')
config.insert_json5('connect/endpoints', json.dumps([router]))
config.insert_json5('connect/timeout_ms', '-1')  # wait until a run has opened its router
config.insert_json5('connect/retry', '{period_init_ms: 50, period_max_ms: 100}')
config.insert_json5('scouting/multicast/enabled', 'false')


def show(sample: zenoh.Sample) -> None:
    """Print a state of all joints."""
    state = store.deserialize_cdr(sample.payload.to_bytes(), 'sensor_msgs/msg/JointState')
    time_ = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
    k = state.name.index('crank')
    print(f'{time_:.3f} s: crank at {state.position[k]:.6f} rad, torque {state.effort[k]:.4f} N m')


with zenoh.open(config) as session:
    session.declare_subscriber('0/joint_states/**', show)  # 0: the domain
    time.sleep(30.0)
