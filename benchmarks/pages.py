"""Sections of the page of the benchmarks in the site, made of what `make bench` has measured."""

from __future__ import annotations

from pathlib import Path

from benchmarks.choose import LOOSE_JOINTS, MIDDLEWARE, SCALING
from benchmarks.problem import problems

PICTURES = Path(__file__).parents[1] / 'docs' / 'pictures'

SIZES = """\
## Cost against size

Links: a crank and pairs of coupler and rocker, each driven by the rocker before it
(`benchmarks/chains.py`), three revolutions; the number of links counts the ground. With
positions only, with all joint forces, by equations of motion with a free crank, and with one loose
joint at the far end. Getting ready is building and compiling its equations for the first time;
heyoka keeps the code on disk, so the next process is faster.

Memory: what Python and NumPy hold at most, where
all motion is kept; that of the whole process for nodes, which keep nothing.
"""

LOOSE = """\
## Loose joints

Each loose joint adds impacts that shake the others. Whole calls of `simulate`, set-up and audit
with them, of machines that are compiled, by how many of their joints are loose (e = 0.5; with
friction 0.1 in the second row of each): ten revolutions of the thesis mechanism, two of an engine,
a fifth of one of `ten_links`. "Times one" is against the same machine with the fewest loose joints
and no friction; an event is an impact or several at one instant, or a contact that lets go, sticks
or slides.

The second table has Exudyn and MuJoCo on the same machines, from pins at the centre until the
first contact stays closed: so far every impact is that of one joint alone, so the impact law need
not say what happens in others (nor have all loose joints struck by then). The error is the largest
of the place of a joint at the end, against our own run at rtol 1e-12, which one at 1e-10 confirms;
without friction one of the peers comes within 2e-7 m of it on every machine. Ours is at rtol 1e-9,
its CPU time with set-up and audit; a peer has the setting of its least error, often the most
expensive, and its CPU time without set-up. Settings expected to take more than 20 s are left out.
With friction the table shows how the laws differ rather than an error: Exudyn's contact levels off
where sliding stops within an impact, and MuJoCo's tendons have no friction across them.
"""

NODES = """\
## Nodes and middleware

What nodes add, on each middleware found (rclpy where [ROS 2](ros2.md) is): real processes on
loopback, quality of service of results (reliable, keep all), one executor in each process.

* Throughput: bursts of 20,000 `bytes` (a JointState that is serialised already, taken in as
  bytes), 10,000 JointState, 5,000 SensorBlock and 2,000 Motion, made by one process and
  unpacked by the other. The rate is the median of the bursts, at the receiving end; CPU times are
  the least.
* Latency: 200 B to another process and back; and one round of credit, from a law of the drive
  that holds for 1 ms more to the motion that a `linkage` in another process publishes for it.
  Work alone is the integration of that millisecond by the library; most of the rest is the node's
  own: samples, books, messages, reports.
* Whole runs: the thesis scene, by the library and as nodes, with the start of all processes. CPU
  per revolution is the difference of runs of 120 and 20 revolutions, without the start. Lost is
  what was sent and is not in the bag; the digest is that of the motion and all impacts.

Made with `--repeats 3` on a machine that did nothing else. On rclpy a callback costs more the more
endpoints its executor waits for (0.09 ms with one subscription, 0.3 ms with 20, 1.2 ms with 80);
on Zenoh it does not. That is what a recorder adds on rclpy.

"""

GIL = """
### Several nodes in one process

One executor runs the nodes of a process in one thread, one callback after the other. The kernels
let go of the lock of the interpreter: beside steps of heyoka of 27 ms (120 bodies) another Python
thread ran at 86 % of its speed, beside `sum` of a list, which holds the lock, at 6 %; compiled
functions of many points let go of it, too. For nodes little follows: stepping is some 0.7 ms of
the 14 ms of CPU time of a recorded revolution, the rest is Python.

Two executors in two threads, the recorder in the second, were tried (Zenoh, 100 revolutions): the
same digest, up to 8 % more CPU time, and 1.6 to 1.7 s instead of 1.9 s, not counting the time
that the first thread waited for a core. A thread for each node took 10 to 25 % more CPU time.
That is too little to give up that callbacks come one by one. Who wants to use two cores has
`--processes`.
"""


def section(title: str, name: str, words: str) -> str:
    """A heading, the command, the picture and the table."""
    table = (PICTURES / f'{name}.txt').read_text(encoding='utf-8')
    picture = (PICTURES / f'{name}.svg').exists()
    shown = f'![{title}](pictures/{name}.svg)\n\n' if picture else ''
    command = f'`make bench BENCH={name}`'
    return f'{words}{command}\n\n{shown}```\n{table}```\n'


def page() -> str:
    """Sections of the page in the site, of what has been measured."""
    parts = []
    for name, problem in problems().items():
        if (PICTURES / f'{name}.txt').exists():
            how = '\n'.join(f'* {m.name}: {m.how}' for m in problem.methods)
            words = f'## {problem.title}\n\n'
            parts.append(section(problem.title, name, words) + f'\n{how}\n')
    if (PICTURES / f'{SCALING}.txt').exists():
        parts.append(section('Cost against size', SCALING, SIZES + '\n'))
    if (PICTURES / f'{LOOSE_JOINTS}.txt').exists():
        parts.append(section('Loose joints', LOOSE_JOINTS, LOOSE + '\n'))
    if (PICTURES / f'{MIDDLEWARE}.txt').exists():
        parts.append(section('Nodes and middleware', MIDDLEWARE, NODES + '\n') + GIL)
    return '\n'.join(parts)
