"""The table of scenes, which is read in place of building their machines."""

from __future__ import annotations

import importlib.util

import pytest
from running import ROOT, run, run_json

from mechanism_sim import scene
from mechanism_sim.catalogue import scene_names, scene_rows

AGAIN = 'config/scenes.tsv is not true: run python docs/scene_table.py'


@pytest.fixture(scope='module')
def written():
    """The program that writes the table."""
    spec = importlib.util.spec_from_file_location('table', ROOT / 'docs' / 'scene_table.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_scenes_are_listed_and_no_machine_is_built(monkeypatch):
    assert [row['name'] for row in scene_rows()] == scene_names(), AGAIN
    monkeypatch.setattr(scene, 'load_scene', None)
    assert run_json('scenes') == scene_rows()
    first = run('scenes').stdout.splitlines()[0].split()
    assert first[0] == scene_names()[0]


@pytest.mark.sample(6)
@pytest.mark.parametrize('row', scene_rows(), ids=lambda row: row['name'])
def test_the_table_is_true(row, written):
    assert '\t'.join(row.values()) == written.row(row['name']), AGAIN
