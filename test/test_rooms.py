"""The rooms of the package: each imports only rooms below it."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / 'mechanism_sim'

#: the floors, from the ground; a room may import what is below, and itself
FLOORS = (
    ('catalogue', 'ending', 'errors', 'terminal'),
    ('arrays', 'numerics', 'units', 'documents', 'strict_json', 'text_table', 'output'),
    ('planar', 'contact'),
    ('hybrid',),
    ('linkages', 'cams', 'gears', 'vibration'),
    ('sensing',),
    ('scene',),
    ('messages', 'recording', 'middleware'),
    ('study', 'sweep', 'bench', 'cycles'),
    ('nodes', 'analysis', 'report', 'export'),
    ('pages',),
    ('cli', '__init__'),
    ('__main__',),
)
FLOOR = {room: i for i, rooms in enumerate(FLOORS) for room in rooms}

#: on these floors rooms may lean on a neighbour, but never on each other
SHARED = FLOOR['messages'], FLOOR['study'], FLOOR['nodes']


def room_of(module):
    """The room of a dotted module name of the package."""
    parts = module.split('.')
    return parts[1] if len(parts) > 1 else '__init__'


def imports(source, module, is_package):
    """Modules of the package that a source text imports, wherever in it: (line, module)."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [(node.lineno, a.name) for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                here = module.split('.')
                up = here[: len(here) - node.level + is_package]
                base = '.'.join([*up, *([base] if base else [])])
            if base == 'mechanism_sim':
                found += [(node.lineno, f'{base}.{a.name}') for a in node.names]
            else:
                found.append((node.lineno, base))
        elif isinstance(node, ast.Call) and getattr(node.func, 'attr', '') == 'import_module':
            found += [
                (node.lineno, a.value)
                for a in node.args
                if isinstance(a, ast.Constant) and isinstance(a.value, str)
            ]
    return [(line, name) for line, name in found if name.split('.')[0] == 'mechanism_sim']


def forbidden(source, module, is_package=False):
    """Sentences about the imports of a source text that go up, or sideways where they may not."""
    room = room_of(module)
    wrong = []
    for line, name in imports(source, module, is_package):
        other = room_of(name)
        if other == room or other not in FLOOR:
            continue
        beside = FLOOR[other] == FLOOR[room]
        if FLOOR[other] > FLOOR[room] or (beside and FLOOR[room] not in SHARED):
            wrong.append(f'{module}:{line}: room {room} imports {name} of room {other}')
    return wrong


def modules():
    for path in sorted(PACKAGE.rglob('*.py')):
        parts = path.relative_to(PACKAGE.parent).with_suffix('').parts
        is_package = parts[-1] == '__init__'
        yield path, '.'.join(parts[:-1] if is_package else parts), is_package


def test_every_file_lives_in_a_room_that_has_a_floor():
    unknown = {room_of(name) for _, name, _ in modules()} - FLOOR.keys()
    assert not unknown


def test_no_room_imports_a_room_above_it():
    wrong = [
        sentence
        for path, name, is_package in modules()
        for sentence in forbidden(path.read_text(encoding='utf-8'), name, is_package)
    ]
    assert not wrong, '\n'.join(wrong)


def test_rooms_of_one_floor_do_not_lean_on_each_other():
    leans = {room: set() for room in FLOOR}
    for path, name, is_package in modules():
        for _, other in imports(path.read_text(encoding='utf-8'), name, is_package):
            if room_of(other) in FLOOR:
                leans[room_of(name)].add(room_of(other))
    TopologicalSorter({a: b - {a} for a, b in leans.items()}).prepare()  # raises at a cycle
    assert 'messages' in leans['middleware']
    assert not leans['messages'] & {'middleware', 'recording'}


@pytest.mark.parametrize(
    ('source', 'module', 'count'),
    [
        ('from mechanism_sim.scene import load_scene', 'mechanism_sim.hybrid.x', 1),
        ('import mechanism_sim.scene.files', 'mechanism_sim.hybrid.x', 1),
        ('from mechanism_sim import scene', 'mechanism_sim.hybrid.x', 1),
        ('def f():\n    from mechanism_sim.nodes import x', 'mechanism_sim.messages.y', 1),
        ('from ..scene import files', 'mechanism_sim.hybrid.x', 1),
        ('from .. import scene', 'mechanism_sim.hybrid.x', 1),
        ('from ..scene import files', 'mechanism_sim.hybrid', 0),
        ('from . import system', 'mechanism_sim.hybrid.x', 0),
        ('from mechanism_sim.contact import x', 'mechanism_sim.planar.y', 1),
        ('from mechanism_sim.messages import x', 'mechanism_sim.recording.y', 0),
        ('from mechanism_sim.nodes import x', 'mechanism_sim.recording.y', 1),
        ('from mechanism_sim.planar import x', 'mechanism_sim.hybrid.y', 0),
        ('from mechanism_sim.errors import InputError', 'mechanism_sim.units', 0),
        ("import importlib\nimportlib.import_module('mechanism_sim.cli')",
         'mechanism_sim.nodes.x', 1),
        ('import numpy', 'mechanism_sim.numerics.x', 0),
    ],
)  # fmt: skip
def test_the_walker_sees_every_way_to_import(source, module, count):
    assert len(forbidden(source, module)) == count


def test_numerics_knows_no_mechanics_and_physics_no_middleware():
    """Importing the engine loads nothing that carries or stores messages."""
    code = (
        'import sys, mechanism_sim.hybrid.event_loop, mechanism_sim.linkages.nominal; '
        'rooms = {m.split(".")[1] for m in sys.modules if m.startswith("mechanism_sim.")}; '
        'print(" ".join(sorted(rooms)))'
    )
    out = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True,
        cwd=PACKAGE.parent,
    )  # fmt: skip
    assert set(out.stdout.split()) <= {
        'errors', 'numerics', 'units', 'planar', 'contact', 'hybrid', 'linkages', 'output',
        'strict_json',
    }  # fmt: skip
