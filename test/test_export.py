"""Machines for other programs: read back there, they are the same."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.nodes.publications import transforms

SCENES = ms.scene_names()


def numbers(text):
    return np.array([float(x) for x in text.split()])


def homogeneous(xyz, yaw=0.0):
    x, y, z = xyz
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


def frames_of_urdf(text, states):
    """Frames of all links in the world (4, 4), by walking the joints as the format says."""
    robot = ET.fromstring(text)
    joints = {j.find('child').get('link'): j for j in robot.iter('joint')}

    def place(joint):
        mimic = joint.find('mimic')
        if mimic is None:
            return states.get(joint.get('name'), 0.0)
        factor, offset = float(mimic.get('multiplier')), float(mimic.get('offset'))
        return factor * states[mimic.get('joint')] + offset

    def frame(link):
        if link not in joints:
            return np.eye(4)
        joint = joints[link]
        origin, kind = joint.find('origin'), joint.get('type')
        roll, pitch, yaw = numbers(origin.get('rpy'))
        assert roll == pitch == 0.0
        found = frame(joint.find('parent').get('link'))
        found = found @ homogeneous(numbers(origin.get('xyz')), yaw)
        if kind == 'fixed':
            return found
        axis = numbers(joint.find('axis').get('xyz'))
        if kind == 'prismatic':
            return found @ homogeneous(place(joint) * axis)
        assert (kind, *axis) == ('continuous', 0.0, 0.0, 1.0)
        return found @ homogeneous((0.0, 0.0, 0.0), place(joint))

    links = [link.get('name') for link in robot.iter('link')]
    assert len({*links}) == len(links) == len(joints) + 1, 'a tree with one root'
    return {link: frame(link) for link in links}


@pytest.mark.parametrize('prefix', ['', 'left/'])
def test_urdf_shows_links_where_tf_has_them(prefix):
    rng = np.random.default_rng(8)
    for name in SCENES:
        machine = ms.load_scene(name)
        mechanism = machine.mechanism
        q = rng.normal(size=(1, len(mechanism.coordinates)))
        states = dict(zip(mechanism.coordinates, q[0], strict=True))
        frames = frames_of_urdf(to_urdf(machine, prefix), states)
        (message,) = transforms(mechanism, np.zeros(1), q, lambda link: f'{prefix}{link}')
        for transform in message.transforms:
            at, turn = transform.transform.translation, transform.transform.rotation
            expected = homogeneous((at.x, at.y, 0.0), 2.0 * np.arctan2(turn.z, turn.w))
            assert np.array_equal(frames[transform.header.frame_id], np.eye(4))
            found = frames[transform.child_frame_id]
            assert np.abs(found - expected).max() < 1e-12, (name, transform.child_frame_id)
