"""Bags that are written without nodes, and what readers of other authors find in bags."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import mechanism_sim as ms
from mechanism_sim.messages.part_states import KINDS
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.studies.run_bag import RunBag
from ros_interfaces.definitions import field_descriptions


def write_bag(path, record, prefixes=('',)):
    """The bag of a run, without middleware; the same run under each of these namespaces."""
    with RunBag(path, record.machine, record.end) as bag:
        bag.add(record.piece)
    if prefixes != ('',):
        single = read_bag(path)
        again = path.with_name('several.mcap')
        with BagWriter(again) as writer:
            for prefix in prefixes:
                for topic in single.topics.values():
                    writer.add_topic(prefix + topic.name, topic.type, topic.qos or Qos())
                for name, message, time in single.raw():
                    writer.write(prefix + name, message, time)
        return again
    return path


def angle_at(motions, link, t):
    """Angle of a link by Motion messages as another reader has them, the plain way."""
    for m in motions:
        n, width = len(m.coordinates), m.degree + 1
        i = list(m.coordinates).index(link)
        for k in range(m.segments):
            dt = t - m.start[k] - m.start_low[k]
            if -1e-12 <= dt <= m.duration[k] + 1e-12:
                powers = m.coefficients[(k * n + i) * width : (k * n + i + 1) * width]
                return math.fsum(c * dt**j for j, c in enumerate(powers))
    raise AssertionError(f'no motion at {t}')


def messages_of(bag, topic):
    """All messages of a topic, decoded by a reader of other authors."""
    with Path(bag).open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages(topics=[topic])]


def fields_of(message, kind):
    """The fields of a decoded state, as a reading has them."""
    names = [name for name, _ in field_descriptions(kind.message.__msgtype__)]
    return {name: getattr(message, name) for name in names if name not in ('header',)}


def assert_states_follow_from_motion(bag, scene, name, rate=100.0):
    """States in a bag are those of its Motion messages, to the last bit."""
    machine, kind = ms.load_scene(scene), KINDS[name]
    expected, sampled = [], 0
    for _, message, _ in read_bag(bag).messages('/motion'):
        motion = motion_of(message)
        t = np.arange(sampled, int(motion.curve.end * rate) + 2) / rate
        t = t[t < motion.curve.end]
        sampled += len(t)
        expected += kind.states(machine, motion, t) if t.size else []
    got = [fields_of(m, kind) for m in messages_of(bag, f'/{kind.topic}')]
    wanted = [{'time': t, 'joint': joint, **fields} for t, joint, fields in expected]
    np.testing.assert_equal(got, wanted)
    assert len(got) == int(np.ceil(rate * motion.curve.end)) * len(kind.joints(machine))
