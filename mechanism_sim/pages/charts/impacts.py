"""Impacts: when, how hard, and where on pin and bushing."""

from __future__ import annotations

from collections import Counter

import numpy as np

from mechanism_sim.analysis.roses import Rose, impact_rose
from mechanism_sim.analysis.wear import WearMap, wear_maps
from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import INK, colour
from mechanism_sim.hybrid.events import Impact
from mechanism_sim.pages.charts.contacts import gaps_of
from mechanism_sim.pages.charts.course import Course, Window
from mechanism_sim.pages.charts.section import Chart, Section
from mechanism_sim.pages.charts.style import brief, chart, pale, polar, written
from mechanism_sim.planar.mechanism import Joint, Revolute
from mechanism_sim.planar.play import joint_of_gap

STEMS = 1500
"""Impacts that a chart shows one by one: of more, the hardest in each of so many bins of time."""

RAYS = 600
"""Impacts that a rose shows: of more, the hardest."""


def impacts(course: Course, skip: int) -> Section | None:
    """Impacts over time, by direction, and what wears the bearings."""
    record = course.record
    struck = [i for i in record.piece.impacts if i.t >= course.begin]
    if not struck:
        return None
    charts = []
    if course.long and any(course.detail.start <= i.t <= course.detail.end for i in struck):
        charts.append(
            _stems(course, struck, course.detail, 'Impacts in the last turns', 'impacts')
        )
    charts.append(_stems(course, struck, course.run, 'Impacts in the whole run', 'impacts-run'))
    hit = {i.joint for i in struck}
    for joint in record.loose_joints:
        if joint in hit:
            rose = impact_rose(record, joint, skip)
            charts += [_rose(course, rose, on_pin) for on_pin in (True, False)]
        if record.machine.physics.has_forces:
            charts += _wear(course, joint, skip)
    return Section('impacts', 'Impacts', _text(course, struck), tuple(charts))


def _text(course: Course, struck: list[Impact]) -> str:
    hardest = max(struck, key=lambda i: i.normal_impulse)
    lost = sum(i.energy_loss for i in struck)
    many = f'{len(struck):,} impacts' if len(struck) > 1 else '1 impact'
    text = (
        f'{many}, {sum(i.normal_impulse for i in struck):.4g} N s and {lost:.4g} J together; the '
        f'hardest in {hardest.joint} at {hardest.t:.6g} s with {hardest.normal_impulse:.4g} N s.'
    )
    if max(Counter(i.joint for i in struck).values()) > STEMS:
        text += f' Of the whole run the hardest of every 1/{STEMS} of its time are drawn.'
    if any(j in {i.joint for i in struck} for j in course.record.loose_joints):
        text += (
            ' Round charts show each impact as a line towards the place struck, as seen from the '
            'part that is struck; Y1 is the hardest.'
        )
    return text


def _stems(course: Course, struck: list[Impact], window: Window, title: str, key: str) -> Chart:
    figure = chart('time [s]', 'normal impulse [mN s]')
    figure.update_xaxes(range=[window.start, window.end])
    figure.update_yaxes(rangemode='tozero')
    for name, number, twin in _places(course):
        own = [i for i in struck if i.joint == name and window.start <= i.t <= window.end]
        own = _hardest(own, window)
        if not own:
            continue
        t = np.array([i.t for i in own])
        impulse = 1e3 * np.array([i.normal_impulse for i in own])
        speed = brief([i.approach_speed for i in own])
        shade = colour(number)
        x = np.repeat(t, 3)
        y = np.array([np.zeros(len(t)), impulse, np.full(len(t), np.nan)]).T.ravel()
        figure.add_scatter(
            x=x, y=brief(y), mode='lines', line={'color': pale(shade, 0.55), 'width': 1},
            hoverinfo='skip', showlegend=False, legendgroup=name, name=f'stems of {name}',
        )  # fmt: skip
        figure.add_scatter(
            x=t, y=brief(impulse), customdata=t, text=[f'{v:.4g} m/s' for v in speed.tolist()],
            mode='markers', name=name, legendgroup=name,
            marker={'color': shade, 'size': 5, 'symbol': 'circle-open' if twin else 'circle'},
            hovertemplate='%{x:.9g} s<br>%{y:.5g} mN s<br>approach %{text}',
        )  # fmt: skip
    figure.update_layout(showlegend=len(figure.data) > 2)
    return Chart(key, title, written(figure), 'time')


def _places(course: Course) -> list[tuple[str, int, bool]]:
    """The gaps with the number of their joint's colour, and whether it is the joint's second."""
    joints = course.record.machine.physics.joints
    return [
        (name, joints.index(joint), i > 0)
        for joint, names in gaps_of(course).items()
        for i, name in enumerate(names)
    ]


def _hardest(struck: list[Impact], window: Window) -> list[Impact]:
    """All impacts, or the hardest of each of so many bins of time."""
    if len(struck) <= STEMS:
        return struck
    width = (window.end - window.start) / STEMS
    best: dict[int, Impact] = {}
    for impact in struck:
        k = min(int((impact.t - window.start) / width), STEMS - 1)
        if k not in best or impact.normal_impulse > best[k].normal_impulse:
            best[k] = impact
    return list(best.values())


def _rose(course: Course, rose: Rose, on_pin: bool) -> Chart:
    """[SB] 8.11: every impact a line towards the place struck, the six hardest marked."""
    part, link = ('pin', rose.pin) if on_pin else ('bushing', rose.bushing)
    degrees = np.degrees(rose.on_pin if on_pin else rose.on_bushing)
    impulse = 1e3 * rose.normal_impulse
    chosen = np.argsort(-impulse, kind='stable')[:RAYS]
    joint = _joint(course, rose.joint).name
    shade = colour(course.record.machine.physics.joints.index(joint))
    figure = polar('mN s', impulse, degrees, showlegend=False)
    r = np.array([np.zeros(len(chosen)), impulse[chosen], np.full(len(chosen), np.nan)]).T
    figure.add_scatterpolar(
        r=brief(r.ravel()), theta=brief(np.repeat(degrees[chosen], 3)), mode='lines',
        line={'color': pale(shade, 0.5), 'width': 1}, hoverinfo='skip', name='impacts',
    )  # fmt: skip
    y = rose.largest
    figure.add_scatterpolar(
        r=brief(impulse[y]), theta=brief(degrees[y]), customdata=rose.time[y],
        text=_labels(impulse[y], np.radians(degrees[y])), mode='markers+text',
        textposition='top center', textfont={'size': 10, 'color': INK},
        marker={'color': shade, 'size': 5}, name='hardest',
        hovertext=[f'Y{i}' for i in range(1, len(y) + 1)],
        hovertemplate='%{hovertext}<br>%{r:.5g} mN s<br>%{theta:.2f} deg<br>%{customdata:.9g} s',
    )  # fmt: skip
    title = f'{rose.joint}: impacts on the {part}, seen from the {link}'
    return Chart(f'rose-{rose.joint}-{part}', title, written(figure), 'polar', joint)


def _labels(size: Array, direction: Array) -> list[str]:
    """Y1, Y2, ..., but nothing where it would lie on one before."""
    place, found = size * np.exp(1j * direction), []
    kept: list[complex] = []
    for i, here in enumerate(place.tolist(), 1):
        free = all(abs(here - other) > 0.22 * size.max() for other in kept)
        found.append(f'Y{i}' if free else '')
        kept += [here] if free else []
    return found


def _wear(course: Course, joint: str, skip: int) -> list[Chart]:
    """Archard's measure of wear by direction on bushing and pin."""
    maps = wear_maps(course.record, joint, skip=skip)
    pair = _joint(course, joint)
    assert isinstance(pair, Revolute)  # noqa: S101 - else it has no maps
    if not any(m.load_way.any() for m in maps):
        return []
    return [
        _map(course, joint, part, wear)
        for part, wear in zip(('bushing', 'pin'), maps, strict=True)
    ]


def _joint(course: Course, gap: str) -> Joint:
    return joint_of_gap(course.record.machine.mechanism, gap)


def _map(course: Course, gap: str, part: str, wear: WearMap) -> Chart:
    joint = _joint(course, gap).name
    shade = colour(course.record.machine.physics.joints.index(joint))
    figure = polar('N m', wear.load_way, np.degrees(wear.middles), showlegend=False)
    figure.add_barpolar(
        r=brief(wear.load_way), theta=brief(np.degrees(wear.middles)),
        width=[360.0 / len(wear.load_way)] * len(wear.load_way),
        marker={'color': pale(shade, 0.6), 'line': {'width': 0}}, name=part,
        hovertemplate='%{theta:.0f} deg<br>%{r:.4g} N m',
    )  # fmt: skip
    title = f'{gap}: sliding wear of the {part} on {wear.link}, normal force times way'
    return Chart(f'wear-{gap}-{part}', title, written(figure), 'polar', joint)
