"""Bags that are written without nodes, and read by readers of other authors."""

from __future__ import annotations

import math
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from mechanism_sim.recording import BagWriter, Qos, read_bag
from mechanism_sim.sweep.bags import RunBag


def write_bag(path, record, prefixes=('',)):
    """The bag of a run, without middleware; the same run under each of these namespaces."""
    with RunBag(path, record.machine, record.end) as bag:
        bag.add(record.piece.motion, record.piece.impacts, record.piece.modes)
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


def foreign(path, topic):
    with Path(path).open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [row.decoded_message for row in reader.iter_decoded_messages(topics=[topic])]
