"""Files of measured signals without a machine: `analyze` and `plot`."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest
import scipy.io
from mcap.writer import Writer
from running import run, run_json
from scipy.io import wavfile

import mechanism_sim as ms
from mechanism_sim import tables
from mechanism_sim.analysis.measurements import measurements
from mechanism_sim.analysis.open_run import AskedSignals
from mechanism_sim.analysis.series import Series
from mechanism_sim.errors import InputError
from mechanism_sim.report import lines
from mechanism_sim.report.charts.lines import chart
from mechanism_sim.tables import Column

draw = lines.draw
RATE, TONE, SIZE, COUNT = 2000.0, 125.0, 3.0, 4096
TIMES = np.arange(COUNT) / RATE
WAVE = SIZE * np.sin(2.0 * math.pi * TONE * TIMES)


@pytest.fixture
def rig(tmp_path):
    """A tone, and a way that is sampled with it."""
    file = tmp_path / 'rig.csv'
    rows = (
        f'{t!r},{y!r},{2.0 + t!r}\n' for t, y in zip(TIMES.tolist(), WAVE.tolist(), strict=True)
    )
    file.write_text('t [s],acc [m/s^2],way [mm]\n' + ''.join(rows))
    return file


def test_a_tone_has_its_size_and_its_line(rig):
    found = run_json('analyze', str(rig), '--spectrum', 'acc')
    acc = found['channels']['acc']
    assert (acc['unit'], acc['samples']) == ('m/s^2', COUNT)
    assert acc['rate'] == pytest.approx(RATE)
    assert acc['rms'] == pytest.approx(SIZE / math.sqrt(2.0), rel=1e-12)
    assert (acc['peak'], acc['crest']) == (SIZE, pytest.approx(math.sqrt(2.0)))
    assert acc['kurtosis'] == pytest.approx(1.5)
    # of a tone the velocity is its acceleration over the angular frequency
    speed = SIZE / math.sqrt(2.0) / (2.0 * math.pi * TONE)
    assert acc['velocity_rms'] == pytest.approx(speed, rel=1e-4)
    assert found['channels']['way']['velocity_rms'] is None
    head = run('analyze', str(rig)).stdout.splitlines()[0]
    assert head.split()[-7:] == ['rms', 'peak', 'crest', 'kurtosis', 'velocity', 'rms', '[mm/s]']
    spectrum = found['details']['spectra']['acc']['spectrum']
    values = np.array(spectrum['values'])
    assert spectrum['frequency'][int(values.argmax())] == pytest.approx(TONE)
    step = spectrum['frequency'][1] - spectrum['frequency'][0]
    assert values.sum() * step == pytest.approx(SIZE**2 / 2.0, rel=1e-3)


def test_the_spectrum_of_a_signal_that_is_zero_has_no_rms(tmp_path):
    file = tmp_path / 'still.csv'
    file.write_text('t [s],acc [m/s^2]\n' + ''.join(f'{k / RATE!r},0\n' for k in range(512)))
    said = run('analyze', str(file), '--spectrum', 'acc').stdout
    assert 'RMS 0 m/s^2 of all lines' in said


def test_whole_numbers_of_a_wav_are_parts_of_its_full_scale(tmp_path):
    file = tmp_path / 'rig.wav'
    wavfile.write(file, int(RATE), np.round(WAVE / 5.0 * 2**15).astype(np.int16))
    found = run_json('analyze', str(file), '--full-scale', '5 m/s^2')['channels']['1']
    assert found['largest'] == pytest.approx(SIZE, abs=5.0 / 2**15)
    assert found['unit'] == 'm/s^2'


@pytest.mark.parametrize('scale', ['5 m/s^2', '5m/s^2', '5e0 m/s^2'])
def test_floats_of_a_wav_are_parts_of_a_full_scale_that_is_given(tmp_path, scale):
    file = tmp_path / 'rig.wav'
    wavfile.write(file, int(RATE), (WAVE / 5.0).astype(np.float32))
    found = run_json('analyze', str(file), '--full-scale', scale)['channels']['1']
    assert (found['largest'], found['unit']) == (pytest.approx(SIZE, rel=1e-6), 'm/s^2')
    assert run_json('analyze', str(file))['channels']['1']['unit'] == ''
    for wrong in ('-5 g', '0g', '5', 'g', 'nan g'):
        done = run('analyze', str(file), '--full-scale', wrong)
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert f"'{wrong}'" in done.stderr


def test_an_envelope_of_little_power_says_so(rig):
    words = '% of the power of the signal: --band gives another'
    for band, little in (('300 Hz:900 Hz', True), ('100 Hz:150 Hz', False)):
        done = run('analyze', str(rig), '--envelope', 'acc', '--band', band)
        assert (words in done.stdout) is little, done.stdout


def test_channels_are_listed_and_plotted_as_they_are(rig, tmp_path):
    assert run_json('plot', str(rig)) == [
        {'name': 'acc', 'unit': 'm/s^2'}, {'name': 'way', 'unit': 'mm'},
    ]  # fmt: skip
    numbers, picture = tmp_path / 'out.csv', tmp_path / 'out.svg'
    run('plot', str(rig), 'acc', '--from', '0.5 s', '-o', str(numbers), '-o', str(picture))
    assert picture.stat().st_size
    rows = list(csv.reader(numbers.open()))[1:]
    kept = TIMES >= 0.5
    t, y = np.array(rows, dtype=float).T
    assert np.allclose(t, TIMES[kept])
    assert np.allclose(y, WAVE[kept], rtol=1e-9, atol=1e-12)


def test_a_channel_is_plotted_over_another(rig, monkeypatch):
    seen = []
    monkeypatch.setattr(lines, 'draw', lambda chart: seen.append(chart) or draw(chart))
    file = rig.with_suffix('.svg')
    done = run('plot', str(rig), 'acc', '--against', 'way', '--from', '0.5 s', '-o', str(file))
    assert done.returncode == 0, done.stderr
    (panel,) = seen[0].panels
    kept = TIMES >= 0.5
    assert panel.x.words == 'way'
    np.testing.assert_allclose(panel.curves[0].x, 2.0 + TIMES[kept], rtol=1e-12)
    np.testing.assert_allclose(panel.curves[0].y, WAVE[kept], rtol=1e-12)


def test_a_line_is_broken_where_samples_are_missing(tmp_path, monkeypatch):
    """Rows that are left out, and cells without a value; numbers are those of the file."""
    seen = []
    monkeypatch.setattr(lines, 'draw', lambda chart: seen.append(chart) or draw(chart))
    kept = [k for k in range(40) if not 10 <= k < 14]
    texts = {
        'rows': ''.join(f'{k},{k}\n' for k in kept),
        'cells': ''.join(f'{k},{k if k in kept else ""}\n' for k in range(40)),
    }
    for name, text in texts.items():
        file, out = tmp_path / f'{name}.csv', tmp_path / f'{name}.npz'
        file.write_text(f't [ms],way [mm]\n{text}')
        done = run_json('plot', str(file), 'way', '-o', str(tmp_path / 'a.svg'), '-o', str(out))
        assert done['series'][0]['samples'] == len(np.load(out)['way']) == 36
        curve = seen[-1].panels[0].curves[0]
        assert np.flatnonzero(np.isnan(curve.y)).tolist() == [10]
        assert curve.x[9:12] == pytest.approx([0.009, 0.009, 0.014])
        said = run('plot', str(file), 'way', '-o', str(tmp_path / 'a.svg')).stderr
        assert 'way: 4 samples are missing; its line is broken there' in said


def test_a_long_line_with_gaps_is_thinned_and_stays_broken():
    t = np.arange(200_000) / 1000.0
    y = np.sin(t)
    y[100_000:100_050] = np.nan
    (curve,) = chart([Series('way', 'N', t, y)], '').panels[0].curves
    assert len(curve.x) < 50_000
    assert np.isnan(curve.y).sum() == 1
    assert curve.x[np.isnan(curve.y)] == pytest.approx(100.0, abs=0.01)


def test_recordings_of_one_quantity_in_other_units_share_their_axes(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(lines, 'draw', lambda chart: seen.append(chart) or draw(chart))
    files = []
    for unit, size in (('deg', 180.0 / math.pi), ('rad', 1.0)):
        files.append(str(tmp_path / f'{unit}.csv'))
        rows = ''.join(f'{k},{size * 0.1 * k!r}\n' for k in range(9))
        (tmp_path / f'{unit}.csv').write_text(f't [s],position.table [{unit}]\n{rows}')
    done = run('plot', *files, 'position.table', '-o', str(tmp_path / 'a.svg'))
    assert done.returncode == 0, done.stderr
    (panel,) = seen[0].panels
    first, second = panel.curves
    np.testing.assert_allclose(first.y, second.y)
    assert panel.y.unit == 'deg'


@pytest.mark.parametrize(
    ('units', 'panels', 'unit', 'size'),
    [(['m/s^2', 'g'], 1, 'm/s^2', 9.80665), (['mm/s^2', 'g'], 1, 'm/s^2', 9.80665),
     (['g', 'g'], 1, 'g', 1.0), (['kg', 'g'], 1, 'kg', 1e-3),
     (['kg', 'm/s^2', 'g'], 2, 'kg', 1e-3)],
)  # fmt: skip
def test_g_is_of_gravity_beside_accelerations_and_a_gram_beside_masses(units, panels, unit, size):
    t = np.arange(3.0)
    series = [Series(f'a{k}', u, t, np.ones(3)) for k, u in enumerate(units)]
    found = chart(series, '').panels
    assert len(found) == panels
    assert found[0].y.unit == unit
    assert found[0].curves[-1].y == pytest.approx(size)


def test_channels_of_a_wav_are_listed_without_its_scale(tmp_path):
    file = tmp_path / 'rig.wav'
    wavfile.write(file, int(RATE), np.zeros((100, 2), np.int16))
    assert [x['name'] for x in run_json('plot', str(file))] == ['1', '2']
    assert 'write for example --full-scale' in run('plot', str(file), '1').stderr


def test_broken_tables_are_refused_in_a_sentence(tmp_path):
    said = 'cannot be read: ', 'cannot be read: ', 'is a file of signals, not a scene'
    pairs = ('plot', 'xlsx'), ('analyze', 'parquet'), ('solve', 'npz')
    for words, (name, ending) in zip(said, pairs, strict=True):
        file = tmp_path / f'out.{ending}'
        file.write_bytes(b'PK')
        done = run(name, str(file))
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert words in done.stderr


@pytest.mark.parametrize('ending', ['csv', 'xlsx', 'mat', 'npz', 'parquet'])
def test_tables_that_are_written_are_read(tmp_path, ending):
    """With the numbers that were written, in sheets to 16 digits, and the units they can hold."""
    t, way = np.arange(50) / 300.0, np.sin(np.arange(50.0))
    file = tmp_path / f'out.{ending}'
    columns = [Column('t', t, 's'), Column('position.arm', way, 'm'), Column('n', [1] * 50)]
    tables.write(file, columns)
    found = AskedSignals(file).channels
    off = 1e-15 if ending == 'xlsx' else 0.0
    np.testing.assert_allclose(found['position.arm'].times, t, off)
    np.testing.assert_allclose(found['position.arm'].values, way, off)
    assert found['position.arm'].unit == ('' if ending == 'npz' else 'm')
    assert found['n'].values.tolist() == [1.0] * 50


def test_tables_without_times_have_a_rate_that_is_given(tmp_path):
    """Such as records of bearings in MATLAB: vectors, matrices, structures."""
    y = np.sin(np.arange(120.0))
    data = {'DE': y, 'RPM': 1797, 'both': np.c_[y, 2.0 * y], 'rig': {'gs': 3.0 * y, 'sr': 1e3}}
    scipy.io.savemat(tmp_path / 'a.mat', data)
    found = AskedSignals(tmp_path / 'a.mat', rate='12 kHz').channels
    assert {*found} == {'DE', 'both.1', 'both.2', 'rig.gs'}
    assert (found['rig.gs'].values == 3.0 * y).all()
    assert (found['both.2'].values == 2.0 * y).all()
    assert found['DE'].rate == pytest.approx(12e3)
    (tmp_path / 'b.txt').write_text('0.5\t1\n1.5\t2\n2.5\t4\n')
    shown = run_json('analyze', str(tmp_path / 'b.txt'), '--sample-rate', '2 Hz')['channels']
    assert (shown['2']['end'], shown['2']['largest']) == (1.0, 4.0)
    dates = np.array(['2026-01-01', '2026-01-02'], 'M8[ns]')
    np.savez(tmp_path / 'c.npz', time=dates, x=[1.0, 2.0])
    for file, more, words in (
        ('a.mat', [], "or give --sample-rate, as '12 kHz'"),
        ('c.npz', [], "column 'time' has dates, as '2026-01-01 00:00:00'"),
        ('b.txt', ['--sample-rate', '0 Hz'], 'must be positive'),
        ('b.txt', ['--sample-rate', '2 kg'], "has the unit 'kg'"),
    ):
        done = run('analyze', str(tmp_path / file), *more)
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert words in done.stderr


def test_a_spectrum_has_units_and_uneven_samples_a_way(tmp_path):
    file = tmp_path / 'a.csv'
    file.write_text('t [ms],a_deg\n' + ''.join(f'{k},{k % 7}\n' for k in range(40)))
    assert ' deg of all lines' in run('analyze', str(file), '--spectrum', 'a_deg').stdout
    file.write_text('t [ms],a\n' + ''.join(f'{k * k},{k}\n' for k in range(40)))
    said = run('analyze', str(file), '--spectrum', 'a').stderr
    assert 'every 0.001 s to 0.077 s: it has no spectrum: take its values at even' in said


def test_python_plots_channels_as_the_command_does(rig):
    assert len(ms.plot(rig, 'acc').axes) == 1
    assert len(ms.plot(str(rig), ['acc', 'way'], start=0.5).axes) == 2
    assert len(ms.plot(rig).axes) == 2
    with pytest.raises(InputError, match="no channel 'ac'; did you mean 'acc'"):
        ms.plot(rig, 'ac')


@pytest.mark.slow
def test_other_commands_say_which_read_signals(rig):
    for name in ('report', 'check', 'solve', 'sweep'):
        done = run(name, str(rig))
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert 'is a file of signals, not a s' in done.stderr
        assert "'mechanism-sim analyze' and 'mechanism-sim plot' read it" in done.stderr
    with pytest.raises(InputError, match='is a file of signals, not a run'):
        ms.open_run(rig)


@pytest.mark.parametrize(
    ('command', 'words'),
    [
        (['analyze', '--orders', 'acc'], '--orders needs a run: a file of signals has'),
        (['analyze', '--spectrum', 'ac'], "no channel 'ac'; did you mean 'acc'?"),
        (['analyze', '--full-scale', '5 m/s^2'], 'has units of its own'),
        (['analyze', '--skip', '2'], '--skip does not apply to a file of signals'),
        (['plot', '--against', 'way'], '--against needs the name of a channel'),
        (['plot', 'acc', '--against', 'angle'], "no channel 'angle'"),
        (['plot', 'acc', '--ideal'], '--ideal does not apply to a file of signals'),
        (['plot', 'ac'], "no channel 'ac'"),
        (['plot', 'acc', '--from', '9 s'], 'no values of acc between these times'),
    ],
)
def test_what_files_do_not_have_is_refused(rig, command, words):
    name, *options = command
    done = run(name, str(rig), *options)
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert words in done.stderr


def test_samples_too_far_apart_for_the_band_have_no_severity(tmp_path):
    """They had one of 0."""
    file = tmp_path / 'slow.csv'
    file.write_text('t [s],acc [m/s^2]\n' + ''.join(f'{k / 16.0},{k % 5}\n' for k in range(99)))
    assert run_json('analyze', str(file))['channels']['acc']['velocity_rms'] is None


def test_a_field_of_a_foreign_bag_has_the_unit_that_its_name_ends_with(tmp_path):
    """``angle_deg`` was read as radians, or as metres where these are measured."""
    path = tmp_path / 'rig.mcap'
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema('rig.State', 'jsonschema', b'{"type": "object"}')
        channel = writer.register_channel('/rig', 'json', schema)
        for k in range(100):
            fields = {'angle_deg': 3.6 * k, 'load_m': 1.0, 'angles_deg': [0.0, 3.6 * k]}
            data = json.dumps(fields).encode()
            writer.add_message(channel, k * 10_000_000, data, k * 10_000_000)
        writer.finish()

    def read(quantity, field):
        (found,) = measurements([path], ['slider_crank'], sensor=quantity, channel=field)
        return found.samples

    for field in ('/rig.angle_deg', '/rig.angles_deg[1]'):
        angle = read('position.crank', field)
        np.testing.assert_allclose(angle, np.radians(3.6) * np.arange(100), rtol=1e-12)
    with pytest.raises(InputError, match=r"'/rig.angle_deg' is in 'deg', but 'm' is measured"):
        read('position.piston', '/rig.angle_deg')
    assert (read('position.crank', '/rig.load_m') == 1.0).all()
