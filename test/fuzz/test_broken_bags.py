"""Whatever happened to a bag, reading it says what is in it, or one sentence.

A sample runs in the suite; ``FUZZ_EXAMPLES=5000 pytest test/fuzz`` takes hours.
"""

import os
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from running import run as command

from mechanism_sim.analysis.record import read_record
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.recording.inventory import info, render_info
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.report.bag import render

pytestmark = pytest.mark.network

EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '25'))
SAMPLE = settings(max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES < 1000, database=None)


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """A short run with an impact or two, recorded by the nodes."""
    path = tmp_path_factory.mktemp('bags') / 'whole.mcap'
    done = command(
        'run', 'four_bar_clearance', '--duration', '0.06', '--json', '--record', str(path)
    )
    assert done.returncode == 0, done.stderr
    return path


def damaged(dice, data):
    """Bytes flipped, cut off, zeroed, lost, doubled or replaced."""
    data = bytearray(data)
    for _ in range(dice.choice((1, 1, 1, 3))):
        at, long, what = (
            dice.randrange(len(data)),
            dice.choice((1, 2, 8, 100, 3000)),
            dice.random(),
        )
        if what < 0.2:
            data[at] ^= 1 << dice.randrange(8)
        elif what < 0.3:
            del data[at:]
        elif what < 0.5:
            data[at : at + long] = bytes(len(data[at : at + long]))
        elif what < 0.65:
            del data[at : at + long]
        elif what < 0.8:
            other = dice.randrange(len(data))
            data[at:at] = data[other : other + long]
        else:
            data[at : at + long] = dice.randbytes(long)
        data = data or bytearray(b'x')
    return bytes(data)


def rewritten(dice, source, path):
    """Copy of a bag with sound checksums around damaged messages, types or metadata."""
    with source.open('rb') as stream, path.open('wb') as out:
        reader, writer = make_reader(stream), Writer(out)
        writer.start('ros2', 'mechanism_sim')
        for record in reader.iter_metadata():
            data = dict(record.metadata)
            if dice.random() < 0.05:
                data[dice.choice(sorted(data))] = dice.choice(('', 'nan', '[[[', 'x' * 9999, '-1'))
            writer.add_metadata(record.name, data)
        channels = {}
        for schema, channel, message in reader.iter_messages():
            if channel.id not in channels:
                kind, extra = schema.name, dict(channel.metadata)
                if dice.random() < 0.03:
                    kind = dice.choice(
                        ('std_msgs/msg/String', 'x', 'mechanism_sim/msg/Motion', '')
                    )
                if dice.random() < 0.05:
                    extra = {'offered_qos_profiles': dice.choice(('- [', '5', '- {depth: x}', ''))}
                known = writer.register_schema(kind, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, known, extra
                )
            data = message.data
            if dice.random() < 0.1:
                data = data[:4] + damaged(dice, data[4:] or b'x')
            times = dice.choice((0, 1 << 63, (1 << 64) - 1)) if dice.random() < 0.01 else None
            time = message.log_time if times is None else times
            writer.add_message(channels[channel.id], time, data, time, message.sequence)
        writer.finish()


READERS = {
    'info': lambda path: render_info(info(path)),
    'messages': lambda path: str(sum(1 for _ in read_bag(path).messages())),
    'analyze': lambda path: render(analyze(read_bag(path))),
    'record': lambda path: repr(len(read_record(read_bag(path)).piece.motion)),
}


def answered(path):
    """Each reader answers, or says one sentence that can be printed."""
    for read in READERS.values():
        try:
            said = read(path)
        except (InputError, RunError) as error:
            said = str(error)
        assert said.encode('utf-8')


@pytest.mark.slow
@given(seed=st.integers(0, 1 << 40))
@SAMPLE
def test_damaged_bags_are_read_or_refused_in_a_sentence(whole, seed):
    path = whole.with_name('damaged.mcap')
    path.write_bytes(damaged(random.Random(seed), whole.read_bytes()))
    answered(path)


@given(seed=st.integers(0, 1 << 40))
@SAMPLE
def test_bags_of_damaged_messages_are_read_or_refused_in_a_sentence(whole, seed):
    path = whole.with_name('rewritten.mcap')
    rewritten(random.Random(seed), whole, path)
    answered(path)
