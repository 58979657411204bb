"""The pictures of the documentation: ``python docs/pictures.py`` writes docs/pictures/*.svg.

They are drawn from the scenes ``four_bar_clearance`` and ``four_bar_measured`` and runs of them;
nothing is drawn by hand.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch
from numpy.typing import NDArray

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine
from mechanism_sim.scene.schema import LinkPart
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.point import PointOnLink

Array = NDArray[np.float64]
Bar = tuple[Array, Array, float]
"""Proximal joint, distal joint [m], angle [rad]."""

FOLDER = Path(__file__).parent / 'pictures'
SCENE = 'four_bar_clearance'
JOINT = 'coupler_rocker'
MAGNIFIED = 320  # how many times the lens enlarges what the machine has there
LENS = (0.595, 0.178)  # [m] its centre in the drawing
GREY, LIGHT = '0.45', '0.80'

STYLE = {
    'font.family': 'DejaVu Sans',
    'font.size': 9.0,
    'axes.linewidth': 0.7,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'svg.hashsalt': 'mechanism_sim',  # the same picture is the same file
    'path.simplify_threshold': 0.3,
}


def unit(angle: Array | float) -> Array:
    """Unit vector (2,) or (2, N) at an angle [rad]."""
    return np.array([np.cos(angle), np.sin(angle)])


def draw_mechanism(machine: Machine, released: Solution) -> Figure:
    """The four-bar to scale, and its loose bearing with the path of the pin."""
    figure = Figure(figsize=(9.0, 9.0 * 0.36 / 0.85))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_aspect('equal')
    axes.set_axis_off()
    links = machine.scene.links
    th2 = np.radians(62.0)
    th3, th4 = machine.nominal.linkage.positions(th2)
    O2, O4 = np.zeros(2), np.array([links['ground'].length, 0.0])
    A = links['crank'].length * unit(th2)
    B = O4 + links['rocker'].length * unit(th4)
    bars = {'crank': (O2, A, th2), 'coupler': (A, B, th3), 'rocker': (O4, B, th4)}
    axes.plot(*zip(O2, O4, strict=True), color=GREY, lw=0.9, ls=(0, (6, 4)), zorder=1)
    for name, (start, end, angle) in bars.items():
        axes.plot(
            *zip(start, end, strict=True), color='0.2', lw=6.5, solid_capstyle='round', zorder=2
        )
        axes.plot(
            *zip(start, end, strict=True), color='0.93', lw=4.5, solid_capstyle='round', zorder=3
        )
        _mass_centre(axes, start + getattr(links, name).cog * unit(angle))
    for sensor in machine.scene.sensors.values():
        at = O4 + sensor.at * unit(th4)
        axes.plot(*at, marker='s', ms=6.5, color='0.1', zorder=6)
        axes.annotate(
            'accelerometer', at, at - (0.034, 0.010), ha='right', va='center',
            arrowprops={'arrowstyle': '-', 'lw': 0.7, 'shrinkA': 1, 'shrinkB': 5},
        )  # fmt: skip
    for pivot in (O2, O4):
        _support(axes, pivot)
    for joint in (O2, A, O4, B):
        axes.add_patch(Circle(joint, 0.0062, fc='white', ec='0.1', lw=1.1, zorder=7))
    _link_names(axes, bars, links)
    names = {
        'ground_crank': (O2, (-0.014, 0.004), 'right'),
        'crank_coupler': (A, (-0.012, 0.013), 'right'),
        JOINT: (B, (0.0, 0.019), 'center'),
        'rocker_ground': (O4, (0.018, 0.004), 'left'),
    }
    for name, (joint, shift, side) in names.items():
        axes.text(*(joint + shift), name, ha=side, va='center', style='italic', zorder=9)
    arrow = FancyArrowPatch(
        0.045 * unit(np.radians(8.0)), 0.045 * unit(th2 - 0.12),
        connectionstyle='arc3,rad=0.22', arrowstyle='-|>', mutation_scale=9, lw=0.9, color='0.1',
    )  # fmt: skip
    axes.add_patch(arrow)
    speed = machine.scene.drive.speed.value * 30.0 / np.pi
    axes.text(*(0.058 * unit(np.radians(24.0))), f'{speed:.0f} rpm', va='center')
    _lens(axes, machine, released, B)
    axes.plot([0.143, 0.243], [-0.034, -0.034], color='0.1', lw=2.0, solid_capstyle='butt')
    axes.text(0.193, -0.029, '100 mm', ha='center', va='bottom')
    axes.set_xlim(-0.130, 0.720)
    axes.set_ylim(-0.045, 0.315)
    return figure


def _mass_centre(axes: Axes, at: Array) -> None:
    axes.add_patch(Circle(at, 0.0042, fc='white', ec='0.1', lw=0.8, zorder=5))
    for turn in (0.0, 180.0):
        wedge = np.radians(np.linspace(turn, turn + 90.0, 20))
        outline = np.column_stack([at, at[:, None] + 0.0042 * unit(wedge)])
        axes.fill(*outline, color='0.1', lw=0, zorder=6)


def _support(axes: Axes, at: Array) -> None:
    x, y = at
    axes.fill(
        [x, x - 0.014, x + 0.014],
        [y, y - 0.024, y - 0.024],
        fc='white',
        ec='0.1',
        lw=1.0,
        zorder=4,
    )
    axes.plot([x - 0.022, x + 0.022], [y - 0.024, y - 0.024], color='0.1', lw=1.0)
    for k in range(6):
        left = x - 0.02 + 0.008 * k
        axes.plot([left, left - 0.006], [y - 0.024, y - 0.031], color='0.1', lw=0.6)


def _link_names(axes: Axes, bars: dict[str, Bar], links: dict[str, LinkPart]) -> None:
    """Names and lengths of the links, along them where there is room."""
    start, end, _ = bars['crank']
    crank = f'crank {1e3 * links["crank"].length:g} mm'
    axes.annotate(
        crank, start + 0.55 * (end - start), (-0.035, 0.045),
        ha='right', va='center',
        arrowprops={'arrowstyle': '-', 'lw': 0.7, 'shrinkA': 1, 'shrinkB': 4},
    )  # fmt: skip
    for name, along, aside in (('coupler', 0.47, 0.013), ('rocker', 0.30, -0.0135)):
        start, end, angle = bars[name]
        x, y = start + along * (end - start) + aside * unit(angle + np.pi / 2)
        turn = np.degrees(angle) - (180.0 if angle > np.pi / 2 else 0.0)
        text = f'{name} {1e3 * links[name].length:g} mm'
        axes.text(x, y, text, rotation=turn, ha='center', va='center', zorder=9)
    ground = f'ground {1e3 * links["ground"].length:g} mm'
    axes.text(0.245, 0.008, ground, ha='center', va='bottom')


def _lens(axes: Axes, machine: Machine, released: Solution, bearing: Array) -> None:
    """The circle in which the pin's centre can move, enlarged, with its path in a revolution."""
    clearance = float(machine.equations.system.gaps[0].clearance)
    radius = MAGNIFIED * clearance
    centre = np.array(LENS)
    edge = 1.22 * radius
    way = centre - bearing
    aside = 0.5 * np.pi + np.arcsin(edge / np.hypot(*way))
    for turn in (aside, -aside):  # the tangents from the bearing to the rim of the lens
        foot = centre + edge * unit(np.arctan2(way[1], way[0]) + turn)
        axes.plot(*zip(bearing, foot, strict=True), color=LIGHT, lw=0.8, zorder=0)
    axes.add_patch(Circle(centre, edge, fc='white', ec='0.1', lw=1.2, zorder=8))
    axes.add_patch(Circle(centre, radius, fc='0.94', ec='0.6', lw=3.0, zorder=9))
    path = centre[:, None] + MAGNIFIED * separation(machine, released, _times(released))
    axes.plot(*path, color='0.0', lw=0.9, zorder=11)
    hits = [i.t for i in released.impacts if i.approach_speed > 1e-3]
    struck = centre[:, None] + MAGNIFIED * separation(machine, released, np.array(hits))
    axes.plot(*struck, ls='none', marker='o', ms=3.6, mfc='white', mec='0.0', mew=0.8, zorder=12)
    axes.plot(*centre, marker='+', ms=8, color='0.1', mew=0.9, zorder=10)
    tip = centre + radius * unit(np.radians(38.0))
    axes.annotate(
        '', tip, centre, zorder=12,
        arrowprops={'arrowstyle': '-|>', 'lw': 0.8, 'shrinkA': 0, 'shrinkB': 0, 'color': '0.1'},
    )  # fmt: skip
    axes.text(
        *(centre + 0.52 * radius * unit(np.radians(38.0)) + (-0.004, 0.008)),
        f'{1e3 * clearance:g} mm',
        rotation=38.0, ha='center', va='center', zorder=12,
    )  # fmt: skip
    axes.text(
        centre[0], centre[1] - edge - 0.008,
        f'{MAGNIFIED} times larger: path of the pin’s\ncentre from the centre of the bushing,\n'
        'one revolution, and its impacts\nfaster than 1 mm/s',
        ha='center', va='top', linespacing=1.35,
    )  # fmt: skip


def _times(released: Solution) -> Array:
    """Times [s] that draw the path of the pin: close together in flight."""
    ends = [*(c.t for c in released.modes), released.duration]
    spans = [
        np.linspace(change.t, end, 500 if change.mode is Mode.FREE_FLIGHT else 300)
        for change, end in zip(released.modes, ends[1:], strict=True)
    ]
    return np.unique(np.concatenate([*spans, [i.t for i in released.impacts]]))


def separation(machine: Machine, solution: Solution, t: Array) -> Array:
    """Vector (2, N) [m] from the bushing's centre to the pin's."""
    x, links = solution.sample(t), machine.scene.links
    th2, th3, th4 = (x[f'position.{name}'] for name in ('crank', 'coupler', 'rocker'))
    Q = (
        links['crank'].length * unit(th2)
        + links['coupler'].length * unit(th3)
        - links['rocker'].length * unit(th4)
    )
    Q[0] -= links['ground'].length
    return Q


def draw_result(solution: Solution, nominal: Solution, period: float) -> Figure:
    """Force, mode of contact and impacts of the loose bearing over two revolutions."""
    figure = Figure(figsize=(8.0, 5.4), layout='constrained')
    top, strip, bottom = figure.subplots(
        3, 1, sharex=True, gridspec_kw={'height_ratios': [3.0, 0.5, 1.5]}
    )
    t = np.linspace(0.0, 2.0 * period, 6000)
    degrees = 360.0 * t / period
    ideal = nominal.sample(t % period)
    force = np.hypot(ideal[f'reaction.{JOINT}.x'], ideal[f'reaction.{JOINT}.y'])
    loose = solution.sample(t)[f'normal_force.{JOINT}']
    top.plot(degrees, force, color='0.65', lw=3.0, label='ideal bearing')
    top.plot(degrees, loose, color='0.0', lw=0.8, label='clearance 0.254 mm, restitution 0.5')
    top.set_ylabel('force in the\ncoupler-rocker bearing [N]')
    top.legend(frameon=False, loc='upper left')
    top.set_ylim(0.0, None)
    _modes(strip, solution, period)
    angle = [360.0 * i.t / period for i in solution.impacts if i.t <= t[-1]]
    impulse = [1e3 * i.normal_impulse for i in solution.impacts if i.t <= t[-1]]
    bottom.plot(angle, impulse, ls='none', marker='o', ms=3.2, mfc='white', mec='0.0', mew=0.7)
    bottom.set_yscale('log')
    bottom.set_ylim(2e-4, 50.0)
    bottom.set_yticks([1e-3, 1e-2, 1e-1, 1.0, 10.0], ['0.001', '0.01', '0.1', '1', '10'])
    bottom.minorticks_off()
    bottom.set_ylabel('normal impulse\nof impacts [mN s]')
    bottom.set_xlabel('crank angle [deg]')
    bottom.set_xlim(0.0, 720.0)
    bottom.set_xticks(range(0, 721, 90))
    for axes in (top, bottom):
        axes.grid(color='0.9', lw=0.6)
        axes.set_axisbelow(True)
    figure.align_ylabels([top, strip, bottom])
    return figure


def _modes(axes: Axes, solution: Solution, period: float) -> None:
    ends = [c.t for c in solution.modes] + [solution.duration]
    for change, end in zip(solution.modes, ends[1:], strict=True):
        flying = change.mode is Mode.FREE_FLIGHT
        start, width = 360.0 * change.t / period, 360.0 * (end - change.t) / period
        axes.broken_barh(
            [(start, width)],
            (1.0 if flying else 0.0, 1.0),
            color='0.0' if flying else '0.75',
            lw=0,
        )
    axes.set_ylim(0.0, 2.0)
    axes.set_yticks([0.5, 1.5], ['following', 'free flight'])
    axes.tick_params(axis='y', length=0)
    axes.spines['left'].set_visible(False)


def draw_chain(machine: Machine, solution: Solution) -> Figure:
    """A hard impact on its way through the chain of the thesis: rocker, across, at the bearing."""
    sensor = machine.scene.sensors['rocker']
    whole, place = sensor.chain(), (sensor.link, sensor.at, sensor.axis, sensor.gravity)
    ideal = Instrument(2e6)
    seen = {
        'truth, but for the impulses of impacts': ideal,
        'transducer 42 kHz': replace(ideal, transducer=whole.transducer),
        'amplifier 2 Hz to 1 kHz': replace(
            ideal, transducer=whole.transducer, amplifier=whole.amplifier
        ),
        '12 bits at 2.7 kHz, noise, hum': replace(whole, trigger=None),
    }
    hard = max(solution.impacts, key=lambda i: i.normal_impulse).t
    figure = Figure(figsize=(8.0, 5.6), layout='constrained')
    panels = figure.subplots(len(seen), 1, sharex=True)
    for axes, (label, instrument) in zip(panels, seen.items(), strict=True):
        channel = Channel(PointOnLink(machine.mechanism, *place), instrument, 'rocker')
        channel.take(solution.motion)
        samples = np.concatenate([b.samples for b in channel.blocks(final=True)])
        t = 1e3 * (np.arange(len(samples)) / instrument.sample_rate - hard)
        shown = (t > -1.5) & (t < 4.5)
        stepwise = instrument.sample_rate < 1e4
        axes.plot(
            t[shown][:: 1 if stepwise else 4],
            samples[shown][:: 1 if stepwise else 4],
            color='0.0',
            lw=0.6,
            marker='o' if stepwise else None,
            ms=3.5,
            mfc='white',
        )
        axes.set_title(label, fontsize=9.0, loc='right')
        axes.grid(color='0.9', lw=0.6)
        axes.set_axisbelow(True)
        axes.margins(y=0.12)
    panels[0].axvline(0.0, color='0.5', lw=0.8, ls=(0, (3, 3)))
    figure.supylabel('acceleration [m/s$^2$]', fontsize=9.0)
    panels[-1].set_xlabel('time since the impact [ms]')
    panels[-1].set_xlim(-1.5, 4.5)
    figure.align_ylabels(panels)
    return figure


def draw_derivatives(path: str, end: float) -> Figure:
    """The rocker's speed, and its derivative by a number beside differences of whole runs."""
    solution = ms.simulate(SCENE, duration=end, derivatives=[path])
    known = solution.derivatives[path]
    t = np.linspace(0.0, end, 3000)
    figure = Figure(figsize=(9.0, 4.0), layout='constrained')
    speed, slope = figure.subplots(2, 1, sharex=True)
    speed.plot(1e3 * t, solution.sample(t, 'velocity.rocker')['velocity.rocker'], 'k', lw=0.8)
    slope.plot(1e3 * t, 1e-3 * known.sample(t, 'velocity.rocker')['velocity.rocker'], 'k', lw=0.8)
    few, h = np.linspace(0.0, end, 90), 1e-5 * known.value
    runs = [ms.load_scene(SCENE, {path: known.value + x}) for x in (h, -h)]
    ends = [ms.simulate(m, duration=end).sample(few, 'velocity.rocker') for m in runs]
    ratio = (ends[0]['velocity.rocker'] - ends[1]['velocity.rocker']) / (2.0 * h)
    slope.plot(1e3 * few, 1e-3 * ratio, 'o', ms=3, mfc='none', mec=GREY)
    speed.set_ylabel('speed of the rocker [rad/s]')
    slope.set_ylabel('derivative by the\nclearance [rad/s/mm]')
    slope.set_xlabel('time [ms]')
    return figure


def main() -> None:
    """Write all pictures."""
    machine = ms.load_scene(SCENE)
    solution = ms.simulate(machine, revolutions=2)
    released = ms.simulate(ms.load_scene(SCENE, {'start': 'centred'}), revolutions=1)
    nominal = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=1)
    measured = ms.load_scene('four_bar_measured')
    FOLDER.mkdir(exist_ok=True)
    with mpl.rc_context(STYLE):
        for name, figure in (
            ('four_bar', draw_mechanism(machine, released)),
            ('bearing_force', draw_result(solution, nominal, machine.drive.period)),
            ('measurement_chain', draw_chain(measured, solution)),
            ('derivatives', draw_derivatives(f'joints.{JOINT}.clearance.radial', 0.23)),
        ):
            file = FOLDER / f'{name}.svg'
            figure.savefig(file, facecolor='white', metadata={'Date': None})


if __name__ == '__main__':
    main()
