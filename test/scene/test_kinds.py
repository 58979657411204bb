"""Kinds of joints and sensors, whose keys a scene has in one class each."""

import pytest

from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.scene.schema import JointPart, SensorPart
from mechanism_sim.scene.sensors import SENSORS


@pytest.mark.parametrize('registry', [KINDS, SENSORS], ids=['joints', 'sensors'])
def test_keys_of_one_name_have_one_type_and_bounds_in_all_kinds(registry):
    """In the class of all kinds, only that of the first is left."""
    first = {}
    for name, kind in registry.items():
        for key, field in kind.model_fields.items():
            own = field.annotation, tuple(map(repr, field.metadata)), field.default
            of, known = first.setdefault(key, (name, own))
            assert own == known, f"'{key}' of {name} is another than that of {of}: rename it"


@pytest.mark.parametrize('name', KINDS)
def test_a_joint_has_the_methods_of_its_kind_alone(name):
    joint = JointPart.model_construct(**{name: ['a', 'b']})
    own = joint.kind_keys
    assert type(own) is KINDS[name]
    assert own.model_fields_set == {name}
    assert own.kind_keys == own


@pytest.mark.parametrize('name', SENSORS)
def test_a_sensor_has_the_methods_of_its_kind_alone(name):
    sensor = SensorPart.model_construct(kind=name, sample_rate=5.0)
    assert type(sensor.kind_keys) is SENSORS[name]
    assert sensor.kind_keys.sample_rate == 5.0
