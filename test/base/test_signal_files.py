"""Signals of files: written by others where there are others, read back in SI units."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest
from running import run
from scipy.io import savemat, wavfile

from mechanism_sim.errors import InputError
from mechanism_sim.signal_files import choose, is_signal_file, read_signals

T = np.arange(200) / 1000.0
Y = 3.0 * np.sin(40.0 * T)


def read_signal(file, channel=None, full_scale=''):
    return choose(file, read_signals(file, full_scale), channel)


def table(folder, text, name='a.csv'):
    file = folder / name
    file.write_text(text, encoding='utf-8')
    return file


def test_csv_has_units_and_leaves_out_what_is_missing(tmp_path):
    rows = '\n'.join(f'{1e3 * t:.9g};{y:.9g};{2 * y:.9g}' for t, y in zip(T, Y, strict=True))
    text = f'# a logger\nTime [ms];rod [mm];acc [g]\n{rows}\n200;nan;1\n201;;1\n'
    file = table(tmp_path, text)
    rod = read_signal(file, 'rod')
    assert (rod.name, rod.unit, len(rod.values)) == ('rod', 'mm', 200)
    assert rod.times == pytest.approx(T)
    assert rod.in_unit('m') == pytest.approx(1e-3 * Y)
    assert rod.rate == pytest.approx(1000.0)
    acc = read_signal(file, 'acc')
    assert len(acc.values) == 202  # its cells are there
    assert acc.in_unit('m/s^2')[:200] == pytest.approx(2.0 * 9.80665 * Y)
    with pytest.raises(InputError, match=r"channel 'rod' is in 'mm', but 'N' is measured"):
        rod.in_unit('N')


def test_a_text_file_of_an_instrument_is_a_signal(tmp_path):
    rows = ''.join(f'{t:.9f}\t{y:.6f}\n' for t, y in zip(T, Y, strict=True))
    text = f'LabVIEW Measurement\nWriter_Version\t2\n***End***\nTime [s]\tacc (g)\n{rows}'
    found = read_signal(table(tmp_path, text, 'lv.txt'))
    assert (found.name, found.unit, len(found.values)) == ('acc', 'g', 200)


def test_units_may_be_below_names_and_spaces_between(tmp_path):
    text = 't acc\n(ms) (m/s²)\n' + ''.join(f'{k} {k * k}\n' for k in range(5))
    found = read_signal(table(tmp_path, text))
    assert (found.name, found.unit, found.values.tolist()) == ('acc', 'm/s²', [0, 1, 4, 9, 16])
    assert found.times == pytest.approx(1e-3 * np.arange(5.0))
    assert found.in_unit('m/s^2') == pytest.approx(np.arange(5.0) ** 2)


def test_columns_of_text_are_no_signals(tmp_path):
    text = 'Zeit [ms];a [m/s^2];state\n0;1,5;on\n1;-;on\n2;N/A;off\n3;2,5;off\n'
    found = read_signal(table(tmp_path, text.replace('Zeit', 'Time')))
    assert (found.name, found.times.tolist(), found.values.tolist()) == (
        'a',
        [0, 0.003],
        [1.5, 2.5],
    )


def test_a_time_without_a_unit_is_in_seconds_and_says_so_once(tmp_path, capsys):
    file = table(tmp_path, 'time,a\n0,1\n0.5,2\n')
    for _ in range(2):
        assert read_signal(file).times.tolist() == [0.0, 0.5]
    said = capsys.readouterr().err
    assert said == (
        "mechanism-sim: signal: 'a.csv': column 'time' has no unit: it is read in seconds\n"
    )


@pytest.mark.parametrize(
    ('heading', 'unit'),
    [('stamp [ns]', 1e-9), ('time_s', 1.0), ('Time_ms', 1e-3), ('stamp_us', 1e-6), ('t_ns', 1e-9)],
)
def test_time_may_be_a_stamp_and_have_its_unit_behind_an_underline(tmp_path, heading, unit):
    file = table(tmp_path, f'{heading},x_s\n0,1\n2,2\n')
    assert read_signal(file).times.tolist() == pytest.approx([0.0, 2.0 * unit], rel=1e-15)


def test_times_in_sentences_have_the_digits_that_tell_them_apart(tmp_path):
    file = table(tmp_path, 't [s],x\n1700000000.015,1\n1700000000.01,2\n')
    with pytest.raises(InputError, match=r'1700000000\.01 s follows 1700000000\.015 s'):
        read_signal(file)


def test_units_may_stand_after_a_slash(tmp_path):
    found = read_signal(table(tmp_path, 'Time / ms;Accel / g\n0,0;1,5\n0,5;2,5\n'))
    assert (found.name, found.unit, found.times.tolist()) == ('Accel', 'g', [0.0, 0.0005])


def test_labels_with_points_are_no_thousands(tmp_path):
    text = 't [s],host,version,x\n0,192.168.1,1.234.5,1\n1,192.168.1,1.234.5,2\n'
    assert read_signal(table(tmp_path, text)).name == 'x'


@pytest.mark.parametrize(
    ('rate', 'start', 'form'),
    [(12800, 0, '.6f'), (25600, 0, '.6f'), (25600, 0, '.7f'), (25600, 1714550400, '.6f'),
     (1500, 0, '.4f'), (51200, 2.0, '.7f')],
)  # fmt: skip
def test_times_that_are_rounded_to_their_last_digit_are_even(tmp_path, rate, start, form):
    t = start + np.arange(2000) / rate
    rows = [f'{a:{form}},{k}\n' for k, a in enumerate(t.tolist())]
    found = read_signal(table(tmp_path, f't [s],x [m]\n{"".join(rows)}'))
    assert found.rate == pytest.approx(rate, abs=found.rate_error)
    assert found.rate_error < 1e-3 * rate
    assert found.missing == 0
    del rows[700:710]
    found = read_signal(table(tmp_path, f't [s],x [m]\n{"".join(rows)}'))
    assert (found.missing, len(found.runs)) == (10, 2)
    assert found.rate == pytest.approx(rate, abs=found.rate_error)


@pytest.mark.parametrize('off', [2e-6, 3e-5])
def test_times_that_are_off_by_more_than_their_last_digit_are_uneven(tmp_path, off):
    t = np.arange(2000) / 12800.0
    t[1000] += off
    rows = ''.join(f'{a:.6f},1\n' for a in t.tolist())
    found = read_signal(table(tmp_path, f't [s],x [m]\n{rows}'))
    assert (found.rate, found.rate_error) == (None, None)


def test_times_whose_digits_are_as_long_as_a_sample_are_uneven(tmp_path):
    rows = ''.join(f'{k / 12800.0:.4f},1\n' for k in range(0, 2000, 2))
    assert read_signal(table(tmp_path, f't [s],x [m]\n{rows}')).rate is None


def test_uneven_instants_are_kept(tmp_path):
    t = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 50))
    rows = '\n'.join(f'{a!r},{a * a!r}' for a in t.tolist())
    found = read_signal(table(tmp_path, f't [s],x [m]\n{rows}\n'))
    assert np.array_equal(found.times, t)
    assert found.rate is None


@pytest.mark.parametrize(
    ('text', 'channel', 'words'),
    [
        ('a [s],x\n0,1\n1,2\n', None, "no column of time: name one 't.*first line is 'a .s.,x'"),
        ('t [s];a [m/s^2]\n0.000;1,5\n', None, "line 2: .* in column 'a', got '1,5': write 1.5"),
        ('t [s];a [m/s^2]\n0,000;1.500,5\n', None, "column 'a', got '1.500,5': write 1500.5"),
        ('t,x\n0,1\n0,2\n', None, 'times of channel .x. must increase, but 0 s follows 0 s'),
        ('t,x\n0,1\n1,nan\n', None, "'x' has 1 samples"),
        (
            't,x\n0,1\n1,2\n2,err\n',
            None,
            "line 4: expected a finite number in column 'x', got 'err'",
        ),
        ('t,x,y\n0,1,1\n1,2,2\n', None, r'several channels \(x, y\): choose one'),
        ('t,rod,y\n0,1,1\n1,2,2\n', 'rot', "no channel 'rot'; did you mean 'rod'"),
        ('t [kg],x\n0,1\n1,2\n', None, "column 't'"),
        ('time,x\n2025-11-29T04:20:00.001,1\n', None, "'time' has dates, as '2025-.* write sec"),
        ('time,x\n2025-11-29 04:20:00Z,1\n', None, 'write seconds from the first sample'),
        ('time,x\n04:20:00.5,1\n', None, "has dates, as '04:20:00.5'"),
        ('time,x\n3/1/2024 10:00:00,1\n', None, "has dates, as '3/1/2024 10:00:00'"),
        ('Zeit;x\n01.03.2024 10:00;1\n', None, "has dates, as '01.03.2024 10:00'"),
        ('time,x\n1-Mar-2024,1\n', None, "has dates, as '1-Mar-2024'"),
    ],
)
def test_csv_that_is_no_signal_is_refused(tmp_path, text, channel, words):
    with pytest.raises(InputError, match=words):
        read_signal(table(tmp_path, text), channel)


def test_other_endings_are_refused(tmp_path):
    assert is_signal_file('a.WAV')
    assert not is_signal_file('a.mcap')
    with pytest.raises(InputError, match=r'expected .csv, .txt, .wav, .uff, .unv, .tdms'):
        read_signals(tmp_path / 'a.dat')
    with pytest.raises(InputError, match='does not exist'):
        read_signals(tmp_path / 'a.wav')


@pytest.mark.parametrize('kind', ['int16', 'int32', 'uint8', 'float32'])
def test_wav_of_every_kind(tmp_path, kind):
    file = tmp_path / 'a.wav'
    full = {'int16': 2.0**15, 'int32': 2.0**31, 'uint8': 128.0, 'float32': 1.0}[kind]
    stored = Y / 4.0 * full if kind != 'float32' else Y
    stored = stored + (128.0 if kind == 'uint8' else 0.0)
    wavfile.write(file, 1000, np.column_stack([stored, stored]).astype(kind))
    scale = '' if kind == 'float32' else '4 m/s^2'
    found = read_signal(file, '2', scale)
    assert found.times == pytest.approx(T)
    assert found.in_unit('m/s^2') == pytest.approx(Y, abs=8.0 / 256.0 if kind == 'uint8' else 2e-4)
    if scale:
        with pytest.raises(InputError, match='--full-scale'):
            read_signal(file, '2')


def test_wav_with_the_other_byte_order(tmp_path):
    data = np.round(Y / 4.0 * 2**15).astype('>i2').tobytes()
    form = struct.pack('>HHIIHH', 1, 1, 1000, 2000, 2, 16)
    body = (
        b'WAVE' + b'fmt ' + struct.pack('>I', 16) + form + b'data' + struct.pack('>I', len(data))
    )
    file = tmp_path / 'a.wav'
    file.write_bytes(b'RIFX' + struct.pack('>I', len(body) + len(data)) + body + data)
    assert read_signal(file, full_scale='4 N').in_unit('N') == pytest.approx(Y, abs=2e-4)


def test_a_wav_that_is_none_is_refused(tmp_path):
    file = tmp_path / 'a.wav'
    file.write_bytes(b'nothing of the kind')
    with pytest.raises(InputError, match=r'a.wav cannot be read'):
        read_signals(file, '1 N')
    wavfile.write(file, 1000, np.zeros(1000, np.int16))
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(InputError, match='it ends before its last sample'):
        read_signals(file, '1 N')


@pytest.mark.parametrize('order', ['', '<', '>'])
def test_universal_files_of_text_and_both_byte_orders(tmp_path, order):
    pyuff = pytest.importorskip('pyuff', reason='the extra signals is not installed')
    file = tmp_path / 'a.uff'
    for k, (name, unit) in enumerate([('rocker', 'mm/s^2'), ('NONE', '')]):
        one = pyuff.prepare_58(
            func_type=1, id1=name, x=T + 0.5, data=(k + 1.0) * Y, return_full_dict=True, binary=0,
            rsp_ent_name='point 7', abscissa_spacing=1, abscissa_min=0.5, abscissa_inc=1e-3,
            abscissa_spec_data_type=17, ordinate_spec_data_type=12, ordinate_axis_units_lab=unit,
            orddenom_spec_data_type=0,
        )  # fmt: skip
        one = {key: 0 if value is None else value for key, value in one.items()}
        pyuff.UFF(str(file)).write_sets(one, 'add' if k else 'overwrite')
    if order:  # its head is text, too
        head = file.read_text(encoding='utf-8').splitlines()[2:13]
        data = np.asarray(Y, f'{order}f8').tobytes()
        first = f'    58b{1 + (order == ">"):6d}     2          11{len(data):12d}     0     0'
        lines = ['    -1', f'{first}           0           0', *head]
        text = ''.join(f'{line:80}\n' for line in lines).encode()
        file.write_bytes(text + data + b'\n    -1\n')
    found = read_signals(file)
    assert [*found] == (['rocker'] if order else ['rocker', 'point 7'])
    assert found['rocker'].times == pytest.approx(T + 0.5)
    assert found['rocker'].in_unit('m/s^2') == pytest.approx(1e-3 * Y, rel=1e-5, abs=1e-7)


def test_tdms_with_its_scaling_and_a_channel_of_time(tmp_path):
    nptdms = pytest.importorskip('nptdms', reason='the extra signals is not installed')
    file = tmp_path / 'a.tdms'
    scaled = {
        'wf_increment': 1e-3, 'wf_start_offset': 0.25, 'unit_string': 'mm',
        'NI_Number_Of_Scales': 1, 'NI_Scale[0]_Scale_Type': 'Linear',
        'NI_Scale[0]_Linear_Slope': 0.001, 'NI_Scale[0]_Linear_Y_Intercept': 0.0,
        'NI_Scale[0]_Linear_Input_Source': 0xFFFFFFFF,
    }  # fmt: skip
    raw = np.round(1000.0 * Y).astype(np.int16)
    channels = [
        nptdms.ChannelObject('rig', 'rod', raw, properties=scaled),
        nptdms.ChannelObject('slow', 'Time', T),
        nptdms.ChannelObject('slow', 'force', Y),
    ]
    with nptdms.TdmsWriter(file) as writer:
        writer.write_segment(channels)
    found = read_signals(file)
    assert [*found] == ['rig/rod', 'slow/force']
    assert found['rig/rod'].times == pytest.approx(T + 0.25)
    assert found['rig/rod'].in_unit('m') == pytest.approx(1e-3 * Y, abs=1e-6)
    assert found['slow/force'].times == pytest.approx(T)


def test_tdms_without_times_takes_a_rate_and_dates_are_no_numbers(tmp_path):
    """Time stamps were read as so many seconds, and of others nobody could give the rate."""
    nptdms = pytest.importorskip('nptdms', reason='the extra signals is not installed')
    file = tmp_path / 'a.tdms'

    def write(*channels):
        with nptdms.TdmsWriter(file) as writer:
            writer.write_segment([nptdms.ChannelObject('rig', *c) for c in channels])

    write(('acc', Y), ('still', Y, {'wf_increment': 0.0}))
    words = re.escape(f"{file}: channel 'acc' has neither an interval") + '.*give --sample-rate'
    with pytest.raises(InputError, match=words):
        read_signals(file)
    found = read_signals(file, rate='1 kHz')
    assert [*found] == ['rig/acc', 'rig/still']
    assert found['rig/acc'].times == pytest.approx(T)
    write(('Time', T), ('acc', Y))
    with pytest.raises(InputError, match="channel 'acc' has times: leave out --sample-rate"):
        read_signals(file, rate='1 kHz')
    stamps = np.datetime64('2024-03-01T10:00:00') + np.arange(200).astype('m8[ms]')
    write(('Time', stamps), ('acc', Y))
    with pytest.raises(InputError, match="channel 'Time' has dates, as '2024-03-01T10:00:00"):
        read_signals(file)


def test_matrices_with_signals_in_rows_and_rows_of_structures_are_signals(tmp_path):
    """200 channels of 3 samples were made of 3 signals; of a row of structures none was seen."""
    file = tmp_path / 'a.mat'
    savemat(file, {'M': np.vstack([Y, 2.0 * Y, 3.0 * Y])})
    found = read_signals(file, rate='1 kHz')
    assert [*found] == ['M.1', 'M.2', 'M.3']
    assert (found['M.2'].values == 2.0 * Y).all()
    row = np.zeros(2, dtype=[('Name', object), ('Data', object)])
    row['Name'], row['Data'] = ['a', 'b'], [Y, 2.0 * Y]
    savemat(file, {'rig': {'Y': row, 'note': 'x'}})
    found = read_signals(file, rate='1 kHz')
    assert [*found] == ['rig.Y.1.Data', 'rig.Y.2.Data']
    assert (found['rig.Y.2.Data'].values == 2.0 * Y).all()


def test_two_samples_at_one_time_but_for_rounding_are_not_even(tmp_path):
    """The rate was that of the others, and a sample that was missing was not."""
    file = table(tmp_path, 't [s],y\n0,0\n0.009,1\n0.009000000000000001,2\n0.027,3\n0.036,4\n')
    found = read_signal(file)
    assert (found.rate, found.missing) == (None, 0)


def test_too_long_a_signal_is_not_to_be_thinned(tmp_path):
    """What lies above half the rate of every 4th sample would be read as something slower."""
    file = tmp_path / 'a.npz'
    np.savez(file, t=np.arange(2_560_001.0), y=np.zeros(2_560_001, np.int8))
    with pytest.raises(InputError, match='2560001 points: allowed are 2560000; take a part'):
        read_signals(file)


@pytest.mark.parametrize('ending', ['uff', 'tdms'])
def test_a_missing_extra_is_named(tmp_path, ending, monkeypatch):
    module = {'uff': 'pyuff', 'tdms': 'nptdms'}[ending]
    monkeypatch.setitem(__import__('sys').modules, module, None)
    with pytest.raises(InputError, match=r'mechanism_sim\[signals\]'):
        read_signals(table(tmp_path, 'x', f'a.{ending}'))


def test_a_missing_sample_parts_a_signal_that_is_even_otherwise(tmp_path):
    """A logger with millisecond stamps dropped three; uneven is what lies between its instants."""
    kept = np.delete(np.arange(200), [50, 120, 121])
    file = table(tmp_path, 't [s],y\n' + ''.join(f'{T[k]:.9g},{Y[k]:.17g}\n' for k in kept))
    signal = read_signal(file)
    assert signal.rate == pytest.approx(1000.0)
    assert [len(x) for x in signal.runs] == [50, 69, 78]
    assert signal.missing == 3
    said = run('analyze', str(file), '--spectrum', 'y').stderr
    assert 'y: 3 samples are missing; spectra are of the longest run' in said
    assert '78 of 197' in said
    assert (np.concatenate(signal.runs) == Y[kept]).all()
    file.write_text('t,y\n0,1\n0.001,2\n0.0025,3\n0.0035,4\n')
    assert read_signal(file).rate is None
    assert read_signal(file).missing == 0


def test_a_channel_may_have_its_unit_behind_an_underscore(tmp_path):
    file = table(tmp_path, 'time_ms,angle_deg,acc_g,n [rpm]\n0,180,1,60\n1,90,2,60\n')
    found = read_signals(file)
    assert {name: c.unit for name, c in found.items()} == {
        'angle_deg': 'deg', 'acc_g': '', 'n': 'rpm',
    }  # fmt: skip
    assert found['angle_deg'].in_unit('rad') == pytest.approx([np.pi, np.pi / 2.0])


def test_values_are_parted_where_samples_are_missing(tmp_path):
    file = table(tmp_path, 't [s],y [N]\n0,1\n0.1,2\n0.2,\n0.3,4\n0.4,5\n0.5,6\n')
    found = read_signal(file)
    t, y = found.parted
    assert t.tolist() == [0.0, 0.1, 0.1, 0.3, 0.4, 0.5]
    np.testing.assert_equal(y, [1.0, 2.0, np.nan, 4.0, 5.0, 6.0])
    file.write_text('t [s],y\n0,1\n0.1,2\n0.25,4\n0.3,5\n')  # uneven, but nothing is missing
    assert read_signal(file).parted[0].tolist() == [0.0, 0.1, 0.25, 0.3]


def test_a_column_called_time_is_the_time_and_names_of_quantities_have_no_unit(tmp_path):
    file = tmp_path / 'm.csv'
    file.write_text('T_ms,time,position.bar_W\n20,0,1\n21,0.5,2\n22,1.0,3\n', encoding='utf-8')
    own = read_signals(file)['position.bar_W']
    assert (own.unit, own.times.tolist()) == ('', [0.0, 0.5, 1.0])


def test_what_no_channel_can_be_is_told(tmp_path, capsys):
    """Complex numbers, as of a spectrum, and matrices of `.npz` were left out without a word."""
    t = np.arange(100) / 100.0
    np.savez(tmp_path / 'a.npz', t=t, y=t**2, z=np.exp(1j * t), M=np.zeros((100, 2)))
    assert [*read_signals(tmp_path / 'a.npz')] == ['y']
    said = capsys.readouterr().err
    assert "signal: 'a.npz': complex numbers are left out: z\n" in said
    assert "signal: 'a.npz': arrays of several dimensions are left out: M\n" in said
