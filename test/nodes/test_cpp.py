"""The C++ header and the C++ example: they see the motion as Python does."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from running import ROOT, TIMEOUT, ros_found, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages.segments import curve_of, unpack
from mechanism_sim.recording.reader import read_bag

COMPILER = shutil.which('g++') or shutil.which('clang++')
ARRAYS = 'start', 'start_low', 'duration', 'turns', 'coefficients'
PROGRAM = r"""
#include <cstdint>
#include <iostream>
#include <string>
#include <vector>
#include "mechanism_sim/motion.hpp"

struct Message
{
  std::vector<std::string> coordinates;
  std::uint32_t segments, degree;
  std::vector<double> start, start_low, duration;
  std::vector<std::int64_t> turns;
  std::vector<double> coefficients;
};

template<class T> void read(std::vector<T> & values)
{
  std::size_t count;
  std::cin >> count;
  values.resize(count);
  for (auto & value : values) {std::cin >> value;}
}

int main()
{
  Message m;
  std::vector<double> times;
  std::cin >> m.segments >> m.degree;
  read(m.coordinates); read(m.start); read(m.start_low); read(m.duration); read(m.turns);
  read(m.coefficients); read(times);
  std::cout.precision(17);
  for (const double t : times) {
    for (std::size_t i = 0; i < m.coordinates.size(); ++i) {
      const auto s = mechanism_sim::evaluate(m, i, t);
      std::cout << s.position << ' ' << s.velocity << ' ' << s.acceleration << '\n';
    }
  }
  int refused = mechanism_sim::holds(m, times.back() + 1.0);
  for (const auto & [i, t] : {std::pair<std::size_t, double>{m.coordinates.size(), times[0]},
      {0, times[0] - 1.0}}) {
    try {mechanism_sim::evaluate(m, i, t);} catch (const std::out_of_range &) {++refused;}
  }
  std::cout << refused << '\n';
}
"""


@pytest.mark.skipif(COMPILER is None, reason='no C++ compiler here')
def test_the_header_evaluates_what_python_evaluates(tmp_path):
    assert COMPILER
    source, program, bag = (tmp_path / name for name in ('main.cpp', 'main', 'run.mcap'))
    source.write_text(PROGRAM)
    flags = '-std=c++17', '-Wall', '-Wextra', '-Werror', f'-I{ROOT / "include"}'
    subprocess.run([COMPILER, *flags, '-o', str(program), str(source)], check=True)
    write_bag(bag, simulated('four_bar_clearance', duration=0.3))
    messages = [m for _, m, _ in read_bag(bag).messages('/motion') if m.segments]
    message = max(messages, key=lambda m: m.segments)
    assert message.segments > 10
    curve = curve_of(unpack(message))
    inner = np.random.default_rng(1).uniform(curve.start[0], curve.end, 200)
    t = np.concatenate([curve.start, inner, [curve.end]])
    counts = ' '.join(f'{len(message.coordinates)} {" ".join(message.coordinates)}'.split())
    text = [f'{message.segments} {message.degree}', counts]
    arrays = [*(getattr(message, name) for name in ARRAYS), t]
    text += [' '.join([str(len(x)), *map(repr, np.asarray(x).tolist())]) for x in arrays]
    done = subprocess.run(
        [str(program)], input='\n'.join(text), capture_output=True, text=True, check=True
    )
    *lines, refused = done.stdout.splitlines()
    assert refused == '2'
    found = np.array([line.split() for line in lines], float).reshape(len(t), -1, 3)
    k, dt = curve.find(t)
    for derivative in range(3):
        wanted = curve.at(k, dt, derivative)
        scale = np.abs(wanted).max(axis=0)
        assert np.abs(found[:, :, derivative] - wanted).max() < 1e-12 * scale.max()


def example(name: str) -> Path | None:
    """A program of the C++ example, where ROS is and it was built."""
    if not ros_found():
        return None
    for prefix in os.environ['AMENT_PREFIX_PATH'].split(os.pathsep):
        program = Path(prefix, 'lib', 'mechanism_sim_example_cpp', name)
        if program.is_file():
            return program
    return None


built = pytest.mark.skipif(example('observer') is None, reason='no C++ example built here')


@contextmanager
def program(name: str, env: dict[str, str], *args: str) -> Iterator[subprocess.Popen[str]]:
    """A program of the example in the background, ended at last."""
    command = [str(example(name)), '--ros-args', *args]
    process = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@built
def test_the_observer_counts_and_evaluates_what_the_bag_has(ros, tmp_path):
    bag, period = tmp_path / 'run.mcap', 1e-3
    with program('observer', ros, '-p', f'period:={period}') as observer:
        outcome = run_json(
            'run', 'four_bar_clearance', '--duration', '1', '--record', str(bag), '--listeners',
            'observer:motion,observer:impacts,observer:joint_states,observer:progress', env=ros,
        )  # fmt: skip
        found = json.loads(observer.communicate(timeout=TIMEOUT)[0])
    recorded = read_bag(bag)
    assert found['impacts'] == outcome['impacts'] == len(list(recorded.messages('/impacts')))
    assert found['joint_states'] == len(list(recorded.messages('/joint_states')))
    solution = ms.simulate(ms.load_scene('four_bar_clearance'), duration=1.0)
    t = period * np.arange(1001)
    sampled = solution.sample(t)
    for name in ('crank', 'coupler', 'rocker'):
        angles = np.array(found[name])
        assert abs(len(angles) - len(t)) <= 1
        n = min(len(angles), len(t))
        assert np.abs(angles[:n] - sampled[f'position.{name}'][:n]).max() < 1e-12


@built
def test_the_torque_loop_holds_the_speed_and_is_the_same_every_time(ros, tmp_path):
    """As the controller in Python does, which gives the same commands to the last bit."""
    digests = []
    for n in range(2):
        bag = tmp_path / f'{n}.mcap'
        with program('torque_loop', ros):
            run_json(
                'run', 'four_bar_governed', '--duration', '2', '--record', str(bag), '--ros-args',
                '-p', 'crank_drive:command_period:=0.005', '--', env=ros,
            )  # fmt: skip
        digests.append(analyze(bag).digest)
    assert digests[0] == digests[1]
    last = [m for _, m, _ in read_bag(bag).messages('/joint_states')][-1]
    assert last.velocity[list(last.name).index('crank')] == pytest.approx(36.65, rel=0.1)
