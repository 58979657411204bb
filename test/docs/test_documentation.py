"""Agreement of the pages with scenes, messages and pictures."""

from __future__ import annotations

import html
import re
import runpy
import shlex
import sys
from pathlib import Path

import pytest
import yaml
from builders import read_scene
from running import ROOT, run

import mechanism_sim as ms
from mechanism_sim.cli.entry import make_parser
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Level
from mechanism_sim.scene.check import check

sys.path.insert(0, str(ROOT / 'docs' / 'site'))

import mechanisms as gallery

DOCS = ROOT / 'docs'
LINKAGES = (DOCS / 'linkages.md').read_text(encoding='utf-8')


def example() -> str:
    """The scene that the page writes out."""
    return re.findall(r'^```yaml\n(.*?)^```$', LINKAGES, re.DOTALL | re.MULTILINE)[0]


def written(folder: Path, text: str) -> str:
    file = folder / 'scene.yaml'
    file.write_text(text, encoding='utf-8')
    return str(file)


@pytest.mark.slow
def test_every_scene_is_once_in_the_gallery_with_its_picture():
    text = gallery.gallery()
    listed = [name for names in gallery.SECTIONS.values() for name in names]
    missing = {*ms.scene_names()} - {*listed}
    assert not missing, 'add these to docs/site/mechanisms.py, then python docs/gallery.py NAME'
    assert sorted(listed) == ms.scene_names()
    assert set(gallery.FREEDOMS) <= set(listed)
    for name in listed:
        _, scene = read_scene(name)
        (row,) = (line for line in text.splitlines() if f'](../config/{name}.yaml)' in line)
        assert scene.title.replace('_', r'\_') in row
        words = ' '.join(scene.description.split())
        assert ' '.join(html.unescape(row).replace('\\', '').split()).count(words)
        assert (DOCS.parent / 'config' / f'{name}.yaml').is_file()
        picture = DOCS / 'pictures' / 'mechanisms' / f'{name}.svg'
        assert f'<img src="{picture.relative_to(DOCS)}"' in row
        assert 5_000 < picture.stat().st_size < 75_000
        assert scene.title in picture.read_text(encoding='utf-8').replace('&#x27;', "'")


@pytest.mark.sample(8)
@pytest.mark.parametrize('name', ms.scene_names())
def test_the_mobility_in_the_gallery_is_that_of_the_scene(name):
    machine = ms.load_scene(name)
    assert f'mobility: {gallery.FREEDOMS.get(name, 1)},' in ' '.join(check(machine).notes)


@pytest.mark.parametrize(
    ('command', 'said'),
    re.findall(r'^\$ mechanism-sim check (.*)\nmechanism-sim: (.*)$', LINKAGES, re.MULTILINE),
)
def test_a_mistake_in_ten_links_is_answered_as_the_documentation_says(command, said):
    scene, *options = shlex.split(command)
    assert options[::2] == ['--set'] * (len(options) // 2)
    with pytest.raises(InputError) as caught:
        ms.load_scene(scene, options[1::2])
    # where an open loop is nearest to closing, the last digits may differ between processors
    answers = [re.sub('nearest with [^;]*;', ';', text) for text in (said, str(caught.value))]
    assert answers[0] == answers[1]


@pytest.fixture
def site(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / 'site'))
    yield
    for name in ('commands', 'keys', 'mathml', 'messages', 'tools'):
        sys.modules.pop(name, None)


@pytest.mark.usefixtures('site')
def test_the_reference_of_keys_has_every_key_of_every_part():
    import keys  # noqa: PLC0415 - of the site

    sections = dict(re.findall(r'^## ([^\n]*)\n(.*?)(?=^## |\Z)', keys.reference(), re.M | re.S))
    parts = keys.parts()
    assert len(sections) == len(parts) > 30
    for part in parts:
        rows = re.findall(r'^\| `(\w+)` \| .* \|$', sections[keys.title(part)], re.MULTILINE)
        assert sorted({*rows}) == sorted(f.alias or n for n, f in part.model_fields.items()), part
    assert '| `radial` | m, > 0 | required |' in sections['Clearance']


@pytest.mark.usefixtures('site')
def test_the_reference_of_messages_has_every_field():
    import messages  # noqa: PLC0415 - of the site

    text = messages.reference()
    for file in (DOCS.parent / 'msg').glob('*.msg'):
        section = text.partition(f'\n## {file.stem}\n')[2].partition('\n## ')[0]
        lines = file.read_text(encoding='utf-8').splitlines()
        fields = [line for line in lines if line.strip() and not line.startswith('#')]
        assert section.count('\n| `') == len(fields), file.name


@pytest.mark.usefixtures('site')
def test_the_reference_of_commands_has_every_command():
    import commands  # noqa: PLC0415 - of the site

    named = re.findall(r'^## (.+)$', commands.reference(), re.MULTILINE)
    assert named == list(make_parser().leaves())


@pytest.mark.usefixtures('site')
def test_digits_after_a_fraction_are_its_two_parts():
    math = pytest.importorskip('docutils.nodes', reason="pip install '.[docs]'").math
    pytest.importorskip('sphinx', reason="pip install '.[docs]'")
    import mathml  # noqa: PLC0415 - of the site

    made = mathml._converted(math('', r'x \le \tfrac12)'), as_block=False)
    assert re.search(r'<mfrac[^>]*>\s*<mn>1</mn>\s*<mn>2</mn>\s*</mfrac>', made)


def test_three_mistakes_are_shown():
    assert LINKAGES.count('$ mechanism-sim check ten_links --set') == 3


def test_the_example_is_a_scene_that_runs(tmp_path):
    machine = ms.load_scene(written(tmp_path, example()))
    assert machine.level is Level.INVERSE_DYNAMICS
    solution = ms.simulate(machine)
    assert abs(solution.energy.residual) < 1e-9 * solution.energy.drive_work


@pytest.mark.slow
def test_the_ten_links_without_masses_move_alike(tmp_path):
    """As the steps of the page make them: kinematic, with four loops."""
    steps = yaml.safe_load((DOCS.parent / 'config/ten_links.yaml').read_text('utf-8'))
    del steps['gravity']
    for link in steps['links'].values():
        for key in ('mass', 'inertia', 'cog'):
            link.pop(key, None)
    sketched = ms.load_scene(written(tmp_path, yaml.safe_dump(steps)))
    assert sketched.level is Level.KINEMATIC
    assert len(check(sketched).relations) == 4
    leg = ms.load_scene('ten_links')
    assert leg.level is Level.INVERSE_DYNAMICS
    positions = [
        ms.simulate(m).sample([0.4], 'position.foot')['position.foot'] for m in (sketched, leg)
    ]
    assert positions[0] == pytest.approx(positions[1], abs=1e-12)


# --- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('scene', 'overrides', 'said'),
    [
        ('ten_links', {'links.lower_rod.length': '619 mm'},
         ['lower_rod is 0.619 m long between its joints, more than the others', '(0.09309 m)']),
        ('ten_links', {'joints.extra.revolute': ['foot.toe', 'ground']}, ['a freedom of -1']),
        ('dump_truck', {'drives.piston.start_position': '3 m'},
         ['the nearest that can be assembled has piston = 1.', 'start the drive there']),
        ('slider_crank', {'loads.f': {'at': 'piston', 'force': ['3*sinn(crank)', 0]}},
         ["loads.f: 'sinn' in '3*sinn(crank)' is not a function", 'known are abs']),
        ('slider_crank', {'loads.f': {'at': 'piston', 'force': ['2**crank', 0]}},
         ["the power 'crank'", 'must be a number']),
        ('slider_crank', {'loads.f': {'at': 'piston', 'force': ['3*sin(crank', 0]}},
         ["'(' was never closed"]),
        ('slider_crank', {'loads.f': {'at': 'piston', 'force': ['10 kg', 0]}},
         ["which is not a unit of 'N'"]),
        ('slider_crank', {'masses.m': {'at': 'ground', 'mass': '1 kg'}}, ['masses.m.at']),
        ('slider_crank', {'drive.profile': {'points': [['0 s', '60 rpm']]}}, ['exclude']),
        ('pendulum', {'links.bar.inertia': 0, 'links.bar.cog': 0},
         ['nothing that turns with the link bar has inertia', 'links.bar.inertia']),
    ],
)  # fmt: skip
def test_what_cannot_be_is_traced_to_its_cause(scene, overrides, said):
    with pytest.raises(InputError) as caught:
        ms.load_scene(scene, overrides)
    for part in said:
        assert part in str(caught.value)


def test_a_link_may_be_a_point_mass():
    machine = ms.load_scene('pendulum', {'links.bar.inertia': '0 kg m^2'})
    solution = ms.simulate(machine, duration=1.0)
    assert abs(solution.energy.residual) < 1e-12


def test_a_missing_joint_is_told_from_missing_masses(tmp_path):
    """Without its guide a slider-crank has three degrees of freedom, and one drive."""
    scene = tmp_path / 'mine.yaml'
    scene.write_text(
        'title: Mine\nmechanism: linkage\n'
        'links: {crank: {length: 50 mm}, rod: {length: 200 mm}, piston: {}}\n'
        'joints:\n'
        '  a: {revolute: [ground, crank]}\n'
        '  b: {revolute: [crank.end, rod]}\n'
        '  c: {revolute: [rod.end, piston]}\n'
        'drive: {speed: 100 rpm}\n',
        encoding='utf-8',
    )
    done = run('check', str(scene))
    assert done.returncode == 2
    assert '3 degrees of freedom, and prescribed are crank' in done.stderr
    assert 'is a joint or a drive missing?' in done.stderr
    short = scene.read_text(encoding='utf-8').replace('[ground, crank]', '[ground]')
    scene.write_text(short, encoding='utf-8')
    assert 'must have 2 entries' in run('check', str(scene)).stderr


def test_the_picture_of_the_rooms_is_that_of_the_layers():
    drawn = runpy.run_path(str(DOCS / 'architecture.py'))
    assert drawn['FILE'].read_text(encoding='utf-8') == drawn['draw']()


@pytest.mark.parametrize('page', ['CONTRIBUTING.md', 'docs/architecture.md'])
def test_pages_for_who_changes_the_program_are_short_and_name_what_there_is(page):
    """Paths in backticks exist, from the repository or from the package."""
    root = DOCS.parent
    text = (root / page).read_text(encoding='utf-8')
    assert len(text.split()) <= 1200
    paths = re.findall(r'`([\w./]+/[\w.]*(?:\.py|/))`', text)
    assert len(paths) > 20
    for path in paths:
        if 'KIND' not in path:
            assert (root / path).exists() or (root / 'mechanism_sim' / path).exists(), path


@pytest.mark.usefixtures('site')
def test_the_page_of_the_editor_has_a_place_for_its_tools():
    import tools  # noqa: PLC0415 - of the site

    assert (DOCS / 'editing.md').read_text(encoding='utf-8').count(tools.MARK) == 1
    rows = re.findall(r'^\| ([^|]+) \| ((?:Shift\+)?[A-Z]) \| [^|]+ \|$', tools.table(), re.M)
    assert len(rows) == len({key for _, key in rows}) > 25
