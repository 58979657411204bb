"""Notebooks: what objects show, what `ms.` completes to, tables of other libraries."""

from __future__ import annotations

import base64
import inspect
import json
import re
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.pages import writing
from mechanism_sim.report import progress
from mechanism_sim.report.picture import Picture

LONGEST_LINE, LONGEST_PAGE = 1_000, 120_000  # characters
API = (ROOT / 'docs' / 'api.md').read_text(encoding='utf-8')


class Cells(HTMLParser):
    """Texts of the cells of tables; fails if a tag is not closed."""

    def __init__(self, text):
        super().__init__()
        self.cells, self.open = [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        if tag not in ('br', 'img'):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ('td', 'th'):
            self.cells.append(data)


@pytest.fixture(scope='module')
def shown():
    machine = ms.load_scene('four_bar_clearance')
    solution = ms.simulate(machine, revolutions=2)
    return {
        'machine': machine,
        'solution': solution,
        'piece': next(iter(ms.stream(machine, revolutions=1))),
        'cycle': ms.cycle(ms.load_scene('four_bar_nominal')),
        'record': ms.open_run(solution),
    }


@pytest.mark.parametrize(
    'name',
    [
        'solution',
        'record',
        *(pytest.param(n, marks=pytest.mark.slow) for n in ('machine', 'piece', 'cycle')),
    ],
)
def test_objects_show_a_picture_and_a_table_and_are_short_as_text(shown, name):
    one = shown[name]
    assert len(repr(one)) < LONGEST_LINE
    page = one._repr_html_()
    assert len(page) < LONGEST_PAGE
    assert len(Cells(page).cells) > 3
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert base64.b64decode(data).startswith(b'\x89PNG')


@pytest.mark.slow
def test_a_cycle_shows_its_extremes_in_units_of_people(shown):
    cells = Cells(shown['cycle']._repr_html_()).cells
    at = cells.index('reaction.coupler_rocker.size')
    assert cells[at + 1] == 'N'
    assert float(cells[at + 4]) == pytest.approx(
        shown['cycle'].extremes()['reaction.coupler_rocker.size'].greatest.value, rel=1e-5
    )


def test_tables_are_short_and_have_units(shown):
    for table in (
        shown['solution'].sample(np.linspace(0.0, 0.3, 20_000)),
        shown['cycle'].table(),
        shown['solution'].impact_table(),
    ):
        assert len(repr(table)) < LONGEST_LINE
        page = table._repr_html_()
        assert len(page) < 10_000
        assert 't [s]' in Cells(page).cells
        assert f'{len(table["t"])} rows' in page
    assert shown['cycle'].table().units['reaction.coupler_rocker.size'] == 'N'
    impacts = shown['solution'].impact_table()
    assert list(impacts['normal_impulse']) == [i.normal_impulse for i in shown['solution'].impacts]
    assert impacts.units['energy_loss'] == 'J'


@pytest.mark.parametrize('library', ['pandas', 'polars'])
def test_tables_become_data_frames(shown, library):
    pytest.importorskip(library)
    table = shown['solution'].sample([0.0, 0.1])
    frame = getattr(table, f'to_{library}')()
    assert list(frame.columns) == list(table)
    assert frame['position.rocker'].to_numpy().tolist() == table['position.rocker'].tolist()
    chosen = shown['solution'].to_frame('position', library=library)
    assert type(chosen) is type(frame)
    assert [*chosen.columns][:2] == ['t', 'position.crank']
    with pytest.raises(InputError, match="library is 'panda'; did you mean 'pandas'"):
        table.to_frame('panda')


def test_a_library_that_is_missing_is_named(shown, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pandas', None)
    with pytest.raises(InputError, match='pip install pandas'):
        shown['cycle'].table().to_pandas()


def test_the_report_has_the_signature_of_what_writes_it():
    assert inspect.signature(ms.report) == inspect.signature(writing.report)


def test_the_package_completes_to_what_is_documented_and_nothing_else():
    directive = (
        r'^\.\. (?:auto(?:function|class|exception)|class):: (?:mechanism_sim\.pages\.writing\.)?'
        r'(\w+)(?:\(\))?$'
    )
    documented = re.findall(directive, API, re.MULTILINE)
    assert sorted([*documented, '__version__']) == dir(ms)
    assert sorted(ms.__all__) == sorted(documented)
    assert all(callable(getattr(ms, name)) for name in documented)
    spaces = {name for name in vars(ms) if not name.startswith('_')}
    modules = {name for name in spaces if type(vars(ms)[name]).__name__ == 'module'}
    assert spaces - modules - {*documented, 'annotations'} == set()  # a room may be called too


@pytest.mark.slow
def test_a_notebook_runs_headless_and_shows_what_it_should():
    nbformat, nbclient = pytest.importorskip('nbformat'), pytest.importorskip('nbclient')
    pytest.importorskip('ipykernel')
    book = nbformat.v4.new_notebook()
    lines = (
        "import mechanism_sim as ms\nm = ms.load_scene('four_bar_clearance')",
        'm',
        's = ms.simulate(m, revolutions=1)\ns',
        's.sample([0.0, 0.1])',
        'ms.cycle(m)',
    )
    book.cells = [nbformat.v4.new_code_cell(line) for line in lines]
    nbclient.NotebookClient(book, timeout=600, kernel_name='python3').execute()
    for cell in book.cells[1:]:
        (given,) = (out for out in cell.outputs if out.output_type == 'execute_result')
        assert len(given.data['text/plain']) < LONGEST_LINE
        assert 100 < len(given.data['text/html']) < LONGEST_PAGE


@pytest.mark.slow
def test_play_and_plot_take_scenes_and_runs_alike(shown):
    file, machine = ROOT / 'config' / 'slider_crank.yaml', ms.load_scene('slider_crank')
    text = file.read_text(encoding='utf-8')
    for source in ('slider_crank', file, text, machine.scene, machine):
        assert 'Slider-crank' in repr(ms.play(source, end='20 ms'))
    for run in (shown['solution'], shown['cycle']):
        assert repr(ms.play(run)).startswith('<')
        assert isinstance(ms.plot(run, 'drive_torque'), Picture)
    longer = ms.play('slider_crank', end='0.7 s')  # than a turn, which is its own run
    data = re.search(r'id="data">(.*?)</script>', longer.page, re.DOTALL)
    t = json.loads(data[1])['frames']['t']
    assert np.frombuffer(base64.b64decode(t['bdata']), t['dtype'])[-1] == pytest.approx(0.7)
    (line,) = ms.plot('slider_crank', 'position.piston', duration='1 s').axes[0].lines
    assert line.get_xdata()[[0, -1]] == pytest.approx([0.0, 1.0])


def test_long_work_shows_its_progress_in_a_notebook_only(monkeypatch):
    shown, times = [], iter(np.arange(0.0, 1e6, 0.6))

    class Handle:
        update = shown.append

    def display(page, display_id):
        assert display_id
        shown.append(page)
        return Handle

    monkeypatch.setattr('time.monotonic', lambda: next(times))
    monkeypatch.setattr('IPython.display.display', display)
    monkeypatch.delitem(sys.modules, 'ipykernel', raising=False)
    ms.simulate('four_bar_clearance', revolutions=4)
    assert shown == []
    monkeypatch.setitem(sys.modules, 'ipykernel', object())
    done = progress.in_notebook('sweep', 10)
    for k in range(11):
        done(k, 0)
    texts = [page.data for page in shown]
    assert 'value="0.1000"' in texts[0]  # after a second
    assert texts[0].endswith('11 s left')
    assert texts[-1] == ''  # and goes when it is over
    shown.clear()
    ms.simulate('four_bar_clearance', revolutions=40)
    assert shown[0].data.startswith('simulate four_bar_clearance <progress')
    assert shown[-1].data == ''


@pytest.mark.slow
def test_values_and_overrides_to_explore_are_of_any_form():
    """Generators and arrays; a list of overrides as for `load_scene`."""
    crank = 'slider_crank', 'drive.speed'
    how = {'quantity': 'position.piston', 'revolutions': 1}
    pages = {
        ms.explore(*crank, values, overrides=overrides, **how).page
        for values in ((x for x in (1.0, 2.0)), np.array([1.0, 2.0]), [1.0, 2.0])
        for overrides in ({'links.rod.length': '0.3 m'}, ['links.rod.length=0.3 m'])
        if not hasattr(values, 'send') or isinstance(overrides, dict)
    }
    assert len(pages) == 1
    for values in ((), None, 3, iter([])):
        with pytest.raises(InputError, match=r'drive.speed: no values are given'):
            ms.explore(*crank, values, **how)


def test_a_film_and_a_player_refuse_the_run_of_another_machine(tmp_path):
    run = ms.simulate('slider_crank', duration='1 ms')
    for call in (ms.play, lambda scene, run: ms.animate(scene, tmp_path / 'a.gif', run)):
        with pytest.raises(InputError, match='the run is not one of <Machine pendulum'):
            call('pendulum', run)
