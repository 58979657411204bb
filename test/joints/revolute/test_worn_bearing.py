"""Pins and bushings that are not round, by closed forms, minimisation and SciPy's integrators."""

import math

import numpy as np
import pytest
import yaml
from builders import made
from event_solution import Machine, Wall, apart, solve
from running import run
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.joints.revolute.worn import LOOKS, WornSurface, locus
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.symbolic import dense

CLEARANCE, PIN = 0.2e-3, 8e-3
PHI = 2.0 * np.pi / LOOKS * np.arange(LOOKS)
FOUR_BAR = {
    'title': 'four-bar', 'mechanism': 'linkage',
    'links': {
        'ground': {'points': {'pivot': ['387 mm', '0 mm']}},
        'crank': {'length': '64 mm', 'mass': 0.6095, 'inertia': 2.645e-3, 'cog': '9 mm'},
        'coupler': {'length': '309 mm', 'mass': 0.2439, 'inertia': 2.95e-3, 'cog': '185 mm'},
        'rocker': {'length': '312 mm', 'mass': 0.2334, 'inertia': 3.176e-3, 'cog': '134 mm'},
    },
    'joints': {
        'ground_crank': {'revolute': ['ground', 'crank']},
        'crank_coupler': {'revolute': ['crank.end', 'coupler']},
        'coupler_rocker': {'revolute': ['coupler.end', 'rocker.end']},
        'rocker_ground': {'revolute': ['rocker', 'ground.pivot']},
    },
    'drive': {'speed': 36.6519}, 'gravity': [0.0, -9.8145],
    'guess': {'coupler': '60 deg', 'rocker': '120 deg'},
}  # fmt: skip


def table(depth, points=90):
    """A surface of a profile."""
    angles = 2.0 * np.pi / points * np.arange(points)
    return {'points': np.transpose([angles, depth(angles).round(15)]).tolist()}


def ellipse(along, across):
    """Distance of an ellipse from its centre, along x and y."""
    return lambda phi: along * across / np.hypot(across * np.cos(phi), along * np.sin(phi))


def scar(deepest, at, wide):
    """A smooth hollow [m]."""
    return lambda phi: deepest * np.exp((np.cos(phi - at) - 1.0) / wide**2)


def four_bar(profile=None, **clearance):
    """That of the thesis as a linkage, loose."""
    given = {'radial': CLEARANCE, 'restitution': 0.5, **clearance}
    if profile:
        given['profile'] = profile
    joint = {**FOUR_BAR['joints']['coupler_rocker'], 'clearance': given}
    return {**FOUR_BAR, 'joints': {**FOUR_BAR['joints'], 'coupler_rocker': joint}}


def struck(solution):
    """Time, normal, approach and impulse of the impacts."""
    rows = [(i.t, i.normal_angle, i.approach_speed, i.normal_impulse) for i in solution.impacts]
    return np.array(rows)


@pytest.mark.parametrize('of_pin', [False, True])
def test_a_locus_is_where_the_nearest_place_of_the_surface_touches(of_pin):
    """By minimisation over the surface, from places of the locus: the distance is the radius."""
    depth = scar(0.08e-3, 1.0, 1.1)
    reach = locus(depth(PHI), CLEARANCE, PIN, of_pin)
    for k in range(0, len(reach), 37):
        z = reach[k] * np.exp(2j * np.pi * k / len(reach))
        sign, radius = (-1.0, PIN) if of_pin else (1.0, PIN + CLEARANCE)

        def space(phi, z=z, sign=sign, radius=radius):
            place = (radius + sign * depth(phi)) * np.exp(1j * phi)
            return sign * abs(place - sign * z)

        nearest = minimize_scalar(space, (np.angle(z) - 0.3, np.angle(z) + 0.3), tol=1e-12).fun
        wanted = -(PIN + CLEARANCE) if of_pin else PIN
        assert nearest == pytest.approx(wanted, abs=1e-12)


def test_the_measure_is_the_distance_beside_the_wall():
    """Of an ellipse: zero with a unit gradient on it, by its closed form."""
    along, across = CLEARANCE, 1.3 * CLEARANCE
    reach = locus(ellipse(along, across)(PHI) - along, along, 0.0)
    found = WornSurface.through(reach, along, 24)
    assert found.error < 1e-8 * CLEARANCE
    t = np.linspace(0.0, 2.0 * np.pi, 50)
    edge, normal = (
        along * np.cos(t) + 1j * across * np.sin(t),
        np.cos(t) / along + 1j * np.sin(t) / across,
    )
    value, gradient = found.measure(edge)
    assert np.abs(value).max() < 1e-8 * CLEARANCE
    assert np.abs(gradient + normal / np.abs(normal)).max() < 1e-7
    inside = (edge[:, None] * np.linspace(0.0, 0.98, 30)).ravel()
    assert (found.measure(inside)[0] > 0.0).all()


@pytest.mark.parametrize(
    'worn', ['both', *(pytest.param(x, marks=pytest.mark.slow) for x in ('bushing', 'pin'))]
)
def test_derivatives_are_those_of_the_value(worn):
    """Gradient, rate and curvature of gap and slip, by differences along a path."""
    profile = {}
    if worn != 'pin':
        profile['bushing'] = table(scar(0.02e-3, 1.0, 1.3))
    if worn != 'bushing':
        profile['pin'] = table(scar(0.02e-3, -2.0, 1.3))
    machine = made(four_bar(profile, pin_radius=PIN, friction=0.1))
    system = machine.equations.system
    frames, gap = system.equations.frames, system.gaps[0]
    names = list(frames.q)
    jets = [gap.value(frames), gap.slip(frames), *gap.normal(frames)]
    wanted = [
        x
        for jet in jets
        for x in (jet.value, jet.rate, jet.curvature, *(jet.gradient.get(c) for c in names))
    ]
    function = compiled.function(
        [dense(x) for x in wanted], [*frames.q.values(), *frames.v.values()]
    )
    values = np.array(system.equations.parameters.values)
    state = machine.initial_state()
    known = dict(zip(system.free, state.q, strict=True))
    q0 = np.array([known.get(c, 0.0) for c in names])
    v0, a0 = np.array([3.0, -2.0, 4.0]), np.array([10.0, -20.0, 7.0])

    def at(t):
        q, v = q0 + t * v0 + 0.5 * t * t * a0, v0 + t * a0
        return function(np.concatenate([q, v]), pars=values[: function.nparams]).reshape(4, -1)

    h = 1e-7
    low, now, high = at(-h), at(0.0), at(h)
    value, rate, curvature, gradient = now[0, 0], now[0, 1], now[0, 2], now[0, 3:]
    assert abs(value) < 1e-9
    assert gradient @ v0 == pytest.approx(rate, rel=1e-12)
    assert (high[0, 0] - low[0, 0]) / (2 * h) == pytest.approx(rate, rel=1e-6)
    assert (high[0, 1] - low[0, 1]) / (2 * h) == pytest.approx(curvature + gradient @ a0, rel=1e-6)
    slip = now[1]
    assert slip[3:] @ v0 == pytest.approx(slip[1], rel=1e-12)
    assert (high[1, 1] - low[1, 1]) / (2 * h) == pytest.approx(slip[2] + slip[3:] @ a0, rel=1e-5)
    normal = now[2:, 0]
    assert np.hypot(*normal) == pytest.approx(1.0, abs=2e-3)
    assert (high[2:, 0] - low[2:, 0]) / (2 * h) == pytest.approx(now[2:, 1], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('depth', 'kind'),
    [
        pytest.param(0.0, 'bushing', marks=pytest.mark.slow),
        (0.1e-3, 'bushing'),
        pytest.param(0.05e-3, 'pin', marks=pytest.mark.slow),
    ],
)
def test_a_round_profile_is_a_round_bearing(depth, kind):
    """To rounding: of no depth, and of an even one a bearing of more clearance."""
    profile = {kind: table(lambda phi: np.full_like(phi, depth))}
    worn = struck(ms.simulate(four_bar(profile, pin_radius=PIN), revolutions=1.5))
    plain = struck(ms.simulate(four_bar(radial=CLEARANCE + depth), revolutions=1.5))
    assert len(worn) == len(plain) > 10
    assert worn[:5] == pytest.approx(plain[:5], rel=1e-7, abs=1e-8)


@pytest.mark.slow
def test_a_bushing_that_is_a_moved_circle_moves_as_one():
    """Depths of a circle about another point of the rocker: that of the bushing moved there."""
    x, y = 0.05e-3, -0.03e-3
    away, at = math.hypot(x, y), math.atan2(y, x)

    def depth(phi):
        across = away * np.sin(phi - at)
        return (
            away * np.cos(phi - at)
            + np.sqrt((PIN + CLEARANCE) ** 2 - across**2)
            - (PIN + CLEARANCE)
        )

    moved = four_bar()
    moved['links'] = {
        **moved['links'],
        'rocker': {**moved['links']['rocker'], 'points': {'hole': [0.312 + x, y]}},
    }
    moved['joints']['coupler_rocker']['revolute'] = ['coupler.end', 'rocker.hole']
    begun = ms.load_scene({**moved, 'start': 'centred'})
    state = begun.initial_state()
    names = begun.equations.system.free
    start = {
        'start': 'centred',
        'initial': {
            'position': dict(zip(names, state.q, strict=True)),
            'velocity': dict(zip(names, state.v, strict=True)),
        },
    }
    shaped = four_bar({'bushing': table(depth, 360)}, pin_radius=PIN)
    worn = struck(ms.simulate({**shaped, **start}, revolutions=1.0))
    plain = struck(ms.simulate({**moved, **start}, revolutions=1.0))
    assert len(worn) == len(plain) > 10
    assert worn[:12] == pytest.approx(plain[:12], rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_a_four_bar_moves_in_an_elliptic_bushing_as_by_scipy():
    """A pin of no radius, by the closed form of its wall: flights, impacts and following."""
    along, across, e = CLEARANCE, 1.5 * CLEARANCE, 0.4
    profile = {'bushing': table(lambda phi: ellipse(along, across)(phi) - along, 180),
               'harmonics': 24}  # fmt: skip
    machine = ms.load_scene({**four_bar(profile, radial=along, restitution=e), 'start': 'centred'})
    solution = ms.simulate(machine, revolutions=1.2)
    state, free = machine.initial_state(), machine.equations.system.free
    begin, rates = (dict(zip(free, x, strict=True)) for x in (state.q, state.v))
    links, speed, ground = FOUR_BAR['links'], FOUR_BAR['drive']['speed'], 0.387
    r2, r3, r4 = 0.064, 0.309, 0.312
    (m3, s3, j3), (m4, s4, j4) = (
        (links[x]['mass'], float(links[x]['cog'].split()[0]) / 1e3, links[x]['inertia'])
        for x in ('coupler', 'rocker')
    )
    j3, j4, g = j3 + m3 * s3**2, j4 + m4 * s4**2, 9.8145

    def u(angle):
        return np.exp(1j * angle)

    def acceleration(_t, q, _v):
        pulled = -(-r2 * speed**2 * u(q[0]) + 1j * g)  # against a crank's end that accelerates
        coupler = m3 * s3 * (u(q[1]).conj() * pulled).imag / j3
        return np.stack([0.0 * q[0], coupler, -m4 * s4 * g * np.cos(q[2]) / j4])

    def seen(q):
        z = r2 * u(q[0]) + r3 * u(q[1]) - ground - r4 * u(q[2])
        z = z * u(-q[2])
        rows = [1j * r * u(a - q[2]) for r, a in ((r2, q[0]), (r3, q[1]), (-r4, q[2]))]
        rows[2] = rows[2] - 1j * z
        return z, rows

    def value(q):
        z, _ = seen(q)
        return 0.5 * along * (1.0 - (z.real / along) ** 2 - (z.imag / across) ** 2)

    def row(q):
        z, rows = seen(q)
        return np.stack(
            [-(z.real / along * r.real + along * z.imag / across**2 * r.imag) for r in rows]
        )

    def bend(q, v):
        h = 1e-6
        return ((row(q + h * v) - row(q - h * v)) * v).sum(axis=0) / (2.0 * h)

    wall = Wall('coupler_rocker', value, row, bend)
    model = Machine((np.inf, j3, j4), acceleration, (wall,), e, 2e-3)
    q0 = np.array([0.0, begin['coupler'], begin['rocker']])
    v0 = np.array([speed, rates['coupler'], rates['rocker']])
    motion = solve(model, q0, v0, solution.duration)
    names = {'coupler_rocker': 'coupler_rocker'}
    scaled = []
    for i in motion.impacts:  # a force along the gradient of what is no distance
        z, _ = seen(motion.sample([i.t])[:3, 0])
        gradient = math.hypot(z.real / along, along * z.imag / across**2)
        scaled.append(i._replace(impulse=i.impulse * gradient, approach=i.approach / gradient))
    motion.impacts[:] = scaled
    times, impulses = apart(motion, solution.impacts, names, 1e-3)
    assert len(motion.impacts) > 10
    assert times < 1e-7
    assert impulses < 1e-5
    assert motion.loss == pytest.approx(sum(i.energy_loss for i in solution.impacts), rel=1e-5)


@pytest.mark.slow
def test_a_spinning_pin_slides_in_an_elliptic_bushing_as_by_scipy():
    """Along the curve parallel to the ellipse, with friction where the pin's surface touches."""
    mass, inertia, mu, g, c = 1.5, 4e-4, 0.15, 9.81, 1e-3
    along, across = PIN + c, PIN + 1.4 * c
    profile = {'bushing': table(lambda phi: ellipse(along, across)(phi) - along, 720),
               'harmonics': 36}  # fmt: skip
    machine = made({
        'links': {'ground': {'points': {'hole': [0.0, 0.0]}},
                  'loose': {'mass': mass, 'inertia': inertia}},
        'joints': {'hole': {'revolute': ['loose', 'ground.hole'], 'clearance': {
            'radial': c, 'pin_radius': PIN, 'restitution': 0.0, 'friction': mu,
            'profile': profile}}},
        'gravity': [0.0, -g], 'start': 'centred',
        'initial': {'velocity': {'loose.x': 0.1, 'loose': 900.0}},
    })  # fmt: skip
    solution = ms.simulate(machine, duration=0.045)
    begin, end = solution.impacts[-1].t + 1e-3, 0.045
    assert begin < 0.02
    seen = solution.sample(np.array([begin, end]))

    def curve(t):
        """Outward normal of the ellipse; the parallel curve and two derivatives: complexes."""
        edge = along * np.cos(t) + 1j * across * np.sin(t)
        d1, d2 = -along * np.sin(t) + 1j * across * np.cos(t), -edge
        n, bend = -1j * d1 / abs(d1), along * across / abs(d1) ** 3
        share = 1.0 - PIN * bend
        falls = 3.0 * PIN * bend * (d1.conjugate() * d2).real / abs(d1) ** 2
        return n, edge - PIN * n, share * d1, share * d2 + falls * d1

    def rate(_, y):
        t, v, spin = y
        n, _, l1, l2 = curve(t)
        weight = -1j * g
        N = mass * ((weight * n.conjugate()).real - (l2 * n.conjugate()).real * v * v)
        tangent = 1j * n
        slip = v * (l1 * tangent.conjugate()).real + PIN * spin
        T = -mu * N * np.sign(slip)
        along_it = (l1.conjugate() * (weight + T / mass * tangent)).real
        return [v, (along_it - (l1.conjugate() * l2).real * v * v) / abs(l1) ** 2,
                PIN * T / inertia]  # fmt: skip

    z, w = (complex(seen[f'{q}.loose.x'][0], seen[f'{q}.loose.y'][0])
            for q in ('position', 'velocity'))  # fmt: skip
    near = math.atan2(z.imag / across, z.real / along)

    def beside(t):
        _, place, tangent, _ = curve(t)
        return ((z - place) * tangent.conjugate()).real

    t0 = brentq(beside, near - 0.5, near + 0.5, xtol=1e-14)
    assert abs(curve(t0)[1] - z) < 1e-5 * c
    l1 = curve(t0)[2]
    v0 = (w * l1.conjugate()).real / abs(l1) ** 2
    found = solve_ivp(rate, (begin, end), [t0, v0, seen['velocity.loose'][0]], rtol=1e-11,
                      atol=1e-12)  # fmt: skip
    t, _, spin = found.y[:, -1]
    place = curve(t)[1]
    assert abs(place - z) > 0.2 * c  # it has gone some way
    assert [place.real, place.imag] == pytest.approx(
        [seen['position.loose.x'][1], seen['position.loose.y'][1]], abs=1e-5 * c
    )
    assert spin == pytest.approx(seen['velocity.loose'][1], rel=1e-7)


@pytest.mark.sample(1)
@pytest.mark.parametrize('deep', [0.01, 0.05])
def test_two_worn_surfaces_count_together_to_the_product_of_their_slopes(deep):
    """The sum is off by about the square of depth over clearance, as it says."""
    profile = {
        kind: table(scar(deep * CLEARANCE, at, 1.0))
        for kind, at in (('bushing', 1.0), ('pin', 2.0))
    }
    (gap,) = made(four_bar(profile, pin_radius=PIN)).equations.system.gaps
    assert 0.02 < gap.shape.off / (deep**2 * CLEARANCE) < 1.0


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        ({'bushing': scar(0.4e-3, 1.0, 0.5)}, 'too narrow for the pin'),
        ({'bushing': scar(0.15e-3, 1.0, 0.6), 'pin': scar(0.1e-3, 1.0, 0.6)}, 'nearly round'),
        ({'bushing': scar(-0.15e-3, 1.0, 0.6)}, 'leaves no room'),
        ({'pin': scar(9e-3, 1.0, 0.6)}, "'pin_radius' must be more than"),
    ],
)
def test_what_the_gap_cannot_follow_is_refused(given, said):
    """One sentence, with what is allowed."""
    profile = {kind: table(depth) for kind, depth in given.items()}
    with pytest.raises(InputError, match=said):
        made(four_bar(profile, pin_radius=PIN))


def test_a_profile_is_of_dry_pins_in_line():
    """Films and misaligned bearings have none, and slots neither."""
    profile = {'bushing': table(scar(0.02e-3, 1.0, 1.0))}
    with pytest.raises(InputError, match='profile and length'):
        made(four_bar(profile, length='20 mm'))
    scene = four_bar(profile)
    loose = scene['joints']['coupler_rocker']
    loose['slot'] = loose.pop('revolute')
    with pytest.raises(InputError, match='profile, which applies to pins in bushings'):
        made(scene)


def test_a_file_of_depths_is_read(tmp_path):
    """Two columns beside the scene, and what `check` says of them."""
    angles = np.arange(0, 360, 5)
    depth = 1e6 * scar(0.02e-3, 1.0, 1.2)(np.radians(angles))
    lines = [f'{a},{d:.6f}' for a, d in zip(angles, depth, strict=True)]
    (tmp_path / 'worn.csv').write_text('\n'.join(['angle [deg],depth [um]', *lines]))
    scene = tmp_path / 'worn.yaml'
    profile = {'bushing': {'file': 'worn.csv'}}
    scene.write_text(yaml.safe_dump(four_bar(profile, pin_radius=PIN)))
    said = run('check', str(scene)).stdout
    assert 'bushing worn up to 2e-05 m' in said
