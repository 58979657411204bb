"""The first minutes: the first screen, misspelt words, a scene of one's own, completion."""

from __future__ import annotations

import json
import re
import shlex

import pytest
import yaml
from builders import read_scene
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.cli import overview
from mechanism_sim.cli.entry import main, make_parser
from mechanism_sim.cli.overview import GROUPS, RENAMED, START, UNLISTED
from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import Clearance
from mechanism_sim.keys.quantities import Part, meanings
from mechanism_sim.scene.files import as_given, check_scene, find_scene, read_yaml
from mechanism_sim.scene.scene_writer import SCHEMA, TEMPLATES, commented, new_scene


@pytest.mark.parametrize('to_the_end', [False, pytest.param(True, marks=pytest.mark.slow)])
def test_alone_it_says_what_to_do_next_with_commands_that_exist(tmp_path, monkeypatch, to_the_end):
    monkeypatch.chdir(tmp_path)
    screen = run()
    assert (screen.returncode, screen.stderr) == (0, '')
    assert len(screen.stdout.splitlines()) < 25
    proposed = re.findall(r'^  mechanism-sim (.*)$', screen.stdout, re.MULTILINE)
    assert proposed == [command for _, commands in START for command in commands]
    for command in proposed:
        if command != '--help':
            make_parser().parse_args(shlex.split(command))
        if to_the_end and not command.startswith('view '):  # which is until it is told to end
            done = run(*shlex.split(command))
            assert done.returncode == 0, done.stderr


def test_the_help_names_every_command_once_by_purpose():
    text = run('--help').stdout
    grouped = [name for names in GROUPS.values() for name in names]
    assert len(grouped) <= 24, 'too many commands: make the new one an option of another'
    for name in make_parser().commands().choices.keys() - {*UNLISTED}:
        assert grouped.count(name) == 1, f'{name} must be once in GROUPS of cli/overview.py'
        assert len(re.findall(rf'^  {name} +\S', text, re.MULTILINE)) == 1
    assert re.fullmatch(r'mechanism-sim \d+\.\d+\S*\n', run('--version').stdout)


def test_a_name_that_moved_is_answered_by_the_new_one(capsys, monkeypatch):
    monkeypatch.setitem(overview.RENAMED, 'calculate', 'mechanism-sim solve')
    commands = make_parser().commands().choices
    for old, new in RENAMED.items():
        assert old not in commands
        program, *words = new.split()
        assert program != 'mechanism-sim' or words[0] in (*commands, '--completion')
        for more in ([], ['x', '--option', '3']):
            with pytest.raises(SystemExit) as ended:
                main([old, *more])
            assert ended.value.code == 2
            assert capsys.readouterr().err == f"mechanism-sim: '{old}' is now '{new}'\n"


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ('slove four_bar_clearance', "there is no command 'slove'; did you mean 'solve'?"),
        ('four_bar_clearance', "a scene, not a command: try 'mechanism-sim check four_bar_cl"),
        ('run.mcap', "a bag, not a command: try 'mechanism-sim analyze run.mcap'"),
        ('solve x --revolution 3', "no option '--revolution'; did you mean '--revolutions'?"),
        ('solve x --set drive.speed=300 rpm', "'rpm' is one argument too many"),
        (f'analyze {"n" * 300}.mcap', "nnn...' is too long a name for a file"),
        ('response x --harmonics 1 y', 'takes SCENE and QUANTITY, before all options; values'),
        ('solve x --duration long', "solve: --duration: 'long' is not a number"),
        ('draw x --positions 1.5', "'1.5' is not a whole number"),
        ('draw x --labels al', "'al' is not possible; did you mean 'all'?"),
        ('solve x --set', 'solve: --set needs a value'),
        ('solve x --sample-rate 9', '--sample-rate needs --output'),
        ('new .yaml', 'is not a scene name'),
        ('check run.mcap', "'run.mcap' is a bag, not a scene"),
        ('solve', 'solve: SCENE is missing'),
        ('report', 'mechanism-sim: report: BAG|SCENE is missing;'),
        ('response', 'mechanism-sim: response: SCENE is missing;'),
        ('check x --json=3', "--json takes no value, but '3' was given"),
        ('check x --latex --markdown', '--markdown and --latex exclude each other'),
        ('--versoin', "no option '--versoin'; did you mean '--version'?"),
        ('node linkage --sceen x', "no option '--sceen'; did you mean '--scene'?"),
        ('check four_bar_clearence', "did you mean 'four_bar_clearance'?"),
        ('new x --from punhc', "there is no scene 'punhc'; did you mean 'punch'?"),
    ],
)
def test_a_misspelt_command_line_is_answered_by_one_sentence(words, said):
    refused = run(*words.split(), refused=True)
    assert (refused.returncode, refused.stdout) == (2, '')
    assert refused.stderr.startswith('mechanism-sim: ')
    assert said in refused.stderr
    assert refused.stderr.count('\n') == 1


def uncommented(text: str) -> str:
    """The file with every key in force that has a place of its own behind a ``#``."""
    return re.sub(r'^( *(?:- )?)# (\w+:)', r'\1\2', text, flags=re.MULTILINE)


def filled(data):
    """Data with empty parts as such: a key above comments only has nothing behind it."""
    if isinstance(data, dict):
        return {key: {} if value is None else filled(value) for key, value in data.items()}
    return data


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', scene_names())
def test_a_new_scene_is_the_one_it_was_begun_from(name):
    data = read_yaml(find_scene(name), 'scene')
    old = check_scene(name, data)
    text = commented(data, as_given(name, data))
    assert max(map(len, text.splitlines())) < 140
    assert filled(yaml.safe_load(text)) == data
    everything = yaml.safe_load(uncommented(text))
    assert len(everything) > len(data)
    assert check_scene(name, everything) == old


def test_whole_blocks_of_defaults_change_nothing_either(tmp_path):
    text = new_scene(str(tmp_path / 'mine'), 'four_bar_clearance').read_text(encoding='utf-8')
    names = 'outputs|solver|initial|transducer|amplifier|adc'
    blocks = rf'^( *)# ({names}):.*\n(?:^\1#   .*\n|^ {{20,}}#.*\n)*'
    opened, count = re.subn(
        blocks, lambda m: re.sub(rf'^{m[1]}# ', m[1], m[0], flags=re.MULTILINE), text,
        flags=re.MULTILINE,
    )  # fmt: skip
    assert count == 6
    (tmp_path / 'open.yaml').write_text(opened, encoding='utf-8')
    assert len(read_yaml(tmp_path / 'open.yaml', 'scene')['outputs']) == 8
    opened_scene = read_scene(str(tmp_path / 'open.yaml'))[1]
    assert opened_scene.title == 'Mine'  # a new scene has a title of its own
    old = read_scene('four_bar_clearance')[1]
    assert opened_scene.model_copy(update={'title': old.title}) == old


def test_new_says_what_comes_next_and_its_scene_moves_as_the_old_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run('new', 'loose', '--from', 'four_bar', '--set', 'drive.speed=300 rpm')
    assert done.stderr == ''
    for command in re.findall(r'^  mechanism-sim (.*)$', done.stdout, re.MULTILINE):
        assert run(*shlex.split(command)).returncode == 0
    same = ('--set', 'drive.speed=300 rpm')
    old = run_json('solve', TEMPLATES['four_bar'], *same)
    assert run_json('solve', 'loose.yaml')['digest'] == old['digest']
    text = (tmp_path / 'loose.yaml').read_text()
    refused = run('new', 'loose')
    assert refused.returncode == 2
    assert 'loose.yaml' in refused.stderr
    assert (tmp_path / 'loose.yaml').read_text() == text


def test_what_cannot_be_built_is_not_written(tmp_path):
    for change, words in (
        ('links.crank.length=1100 mm', 'not shorter than the three other links'),
        ('links.crank.lenght=9 mm', "did you mean 'length'"),
    ):
        with pytest.raises(InputError, match=words):
            new_scene(str(tmp_path / 'mine'), 'four_bar_clearance', [change])
    with pytest.raises(InputError, match='cannot be written'):
        new_scene(str(tmp_path / 'nowhere' / 'mine'), 'four_bar_clearance')
    assert not list(tmp_path.iterdir())


def test_editors_find_every_scene_good_and_a_mistake_in_one(tmp_path, monkeypatch):
    jsonschema = pytest.importorskip('jsonschema')
    monkeypatch.chdir(tmp_path)
    schema = run_json('scenes', '--schema')
    check = jsonschema.Draft202012Validator(schema)
    for name in scene_names():
        data = read_yaml(find_scene(name), 'scene')
        assert check.is_valid(data), name
        assert not check.is_valid(data | {'gravitiy': [0, 0]})
    about = schema['$defs']['Clearance']['properties']['radial']['description']
    assert about == meanings(Clearance)['radial']
    assert 'yaml-language-server' not in new_scene('one', 'punch').read_text()
    (tmp_path / SCHEMA).write_text(json.dumps(schema))
    assert SCHEMA in new_scene('two', 'punch').read_text().splitlines()[0]


def test_every_key_of_a_scene_has_a_meaning():
    def parts(kind: type[Part]) -> set[type[Part]]:
        return {kind}.union(*map(parts, kind.__subclasses__()))

    for kind in parts(Part):
        if '.scene.' in kind.__module__:
            missing = {f.alias or n for n, f in kind.model_fields.items()} - set(meanings(kind))
            assert not missing, kind


def test_a_key_with_nothing_behind_it_is_left_out():
    data = read_yaml(find_scene('four_bar_measured'), 'scene')
    assert check_scene('x', data) == check_scene('x', data | {'outputs': None, 'duration': None})
    with pytest.raises(InputError, match="unknown key 'output'"):
        check_scene('x', data | {'output': None})
    assert ms.load_scene('four_bar_clearance', {'solver.rtol': None})
