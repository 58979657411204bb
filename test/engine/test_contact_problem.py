"""Contacts at an instant, of bodies that are nothing but masses and directions."""

import math

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.engine.contact import problem as instant
from mechanism_sim.engine.contact import respond
from mechanism_sim.engine.contact.chatter import ChatterRule, remaining_time
from mechanism_sim.engine.contact.impact import Hypothesis
from mechanism_sim.engine.contact.problem import (
    ContactArrays,
    ContactProblem,
    Instant,
    Limits,
    Resting,
    problem_of,
)
from mechanism_sim.engine.contact.respond import write_flags
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.row_kernels import run_row
from mechanism_sim.numerics.complementarity import BACKWARD, FORWARD, OPEN, STICK

LIMITS = Limits(touching=1e-15, tie=1e-12, bare=1e-12, still=1e-11, allowed=1e-12, resolved=1e-14)


class Masses:
    """Bodies with f freedoms and masses M, whose m gaps open along rows J; in r rows."""

    def __init__(self, rng, m, f, friction=0.0, restitution=0.5):
        self.M = rng.uniform(0.5, 2.0, f)
        self.J = rng.normal(size=(2 * m if friction else m, f))
        self.v = rng.normal(size=f)
        self.drives = rng.normal(size=(len(self.J), 2))
        self.q = np.zeros(f)
        self.a = rng.normal(size=f)
        self.closed = np.zeros(m, dtype=np.bool_)
        self.laws = (np.full(m, restitution), np.full(m, friction), np.zeros(m, dtype=np.int64))

    @property
    def problem(self):
        m, response = len(self.closed), self.J / self.M
        return ContactProblem(
            self.J[:m] @ self.q,
            self.J @ self.v,
            self.J @ self.a,
            self.J @ self.a,
            response,
            response @ self.J.T,
            self.drives,
            np.arange(float(m)),
            np.zeros(0),
            self.closed,
            *self.laws,
        )

    @property
    def energy(self):
        return 0.5 * float(self.M @ self.v**2)


@pytest.mark.parametrize('friction', [0.0, 0.3])
@pytest.mark.parametrize('m', [1, 2, 3])
def test_an_impact_changes_momentum_by_its_impulses_and_loses_what_it_says(m, friction):
    rng = np.random.default_rng(m)
    rates = np.array([3.0, -2.0])
    for n in range(40):
        masses = Masses(rng, m, 2 * m + 2, friction)
        if masses.problem.rate[0] >= 0.0:
            masses.v *= -1.0
        if n % 2 and m > 1:
            masses.closed[1] = True
        before, energy, log = masses.v.copy(), masses.energy, np.zeros((m, 12))
        rate = masses.problem.rate
        touching, resting = np.zeros((2, m), dtype=bool)
        done = instant.impact_of_all(
            masses.problem, LIMITS, 0, Instant(2.5, rates, masses.v), log, 0, touching, resting
        )
        assert done.found
        assert touching.all()
        assert done.rests == (resting.any() or masses.closed.any())
        rows = log[: done.entered]
        gaps = rows[:, instant.GAP].astype(int)
        impulse = rows[:, instant.NORMAL] @ masses.J[gaps]
        drive = rows[:, instant.NORMAL] @ masses.drives[gaps]
        if friction:
            impulse += rows[:, instant.TANGENTIAL] @ masses.J[m + gaps]
            drive += rows[:, instant.TANGENTIAL] @ masses.drives[m + gaps]
        assert masses.M * (masses.v - before) == pytest.approx(impulse, abs=1e-12)
        assert rows[:, instant.LOSS].sum() == pytest.approx(energy - masses.energy, abs=1e-12)
        assert rows[:, instant.DRIVE].sum() == pytest.approx(drive.sum())
        assert rows[:, instant.WORK].sum() == pytest.approx(drive @ rates)
        assert (rows[:, instant.T] == 2.5).all()
        after = masses.problem.rate
        assert rows[:, instant.APPROACH] == pytest.approx(-rate[gaps])
        assert rows[:, instant.REBOUND] == pytest.approx(np.maximum(after[gaps], 0.0), abs=1e-12)
        if m == 1:
            assert after[0] == pytest.approx(-0.5 * rate[0])
        least = np.where(masses.closed, 0.0, 0.5 * np.maximum(-rate[:m], 0.0))
        assert (after[:m] >= least - 1e-12).all()
        assert after[gaps] == pytest.approx(least[gaps], abs=1e-12)  # who pushed is just there


def test_coming_to_rest_is_booked_as_the_energy_that_it_loses():
    """And as what the drives give; the rows that are kept may repeat each other."""
    rng = np.random.default_rng(7)
    for n in range(20):
        masses = Masses(rng, 3, 8, friction=0.2)
        if n % 2:
            masses.J[2] = masses.J[0] - masses.J[1]
        kept, row, energy = np.array([1, 1, 1, 1, 0, 0], dtype=bool), np.zeros(12), masses.energy
        J = masses.J[kept]
        impulse = np.linalg.lstsq(J / masses.M @ J.T, -J @ masses.v, rcond=1e-10)[0]
        rates = np.array([3.0, -2.0])
        if n % 2:
            masses.drives[2] = masses.drives[0] - masses.drives[1]
        instant.book_rest(masses.problem, LIMITS, kept, rates, row)
        masses.v += J.T @ impulse / masses.M
        assert masses.J[kept] @ masses.v == pytest.approx(0.0, abs=1e-11)
        assert row[instant.LOSS] == pytest.approx(energy - masses.energy)
        assert row[instant.LOSS] > 0.0
        assert row[instant.DRIVE] == pytest.approx((impulse @ masses.drives[kept]).sum())
        assert row[instant.WORK] == pytest.approx(impulse @ masses.drives[kept] @ rates)


@pytest.mark.parametrize('way', [1.0, -1.0])
@pytest.mark.parametrize('m', [1, 3])
def test_release_opens_gaps_by_a_hair_at_rest_unless_they_rise(m, way):
    """A pin that an impact beside it lifts was stopped: the drive's work was booked nowhere."""
    masses = Masses(np.random.default_rng(m), m, 7)
    masses.q, masses.v = np.full(7, 1e-9), way * masses.v
    x = np.array([*masses.q, *masses.v])
    chosen = np.array([True, False, True][:m])
    rates = (masses.J[:m] @ masses.v)[chosen]
    instant.release(masses.problem, chosen, 1e-14, 1e-9, x)
    assert masses.J[:m][chosen] @ x[:7] == pytest.approx(1e-14, rel=1e-6)
    assert masses.J[:m][chosen] @ x[7:] == pytest.approx(np.maximum(rates, 0.0), abs=1e-14)
    assert np.abs(rates).min() > 1e-3


def test_the_rest_of_a_chatter_lasts_as_long_as_its_flights():
    rebound, pull, e = 0.3, -9.81, 0.6
    flights = [-2.0 * rebound * e**k / pull for k in range(200)]
    assert remaining_time(rebound, pull, e) == pytest.approx(sum(flights))
    assert remaining_time(rebound, 1.0, e) == 0.0


def test_the_last_bounce_takes_all_of_the_approach_and_says_how_long_others_would_last():
    rule = ChatterRule(1e-10, 0.0, 0.3)
    limits = LIMITS._replace(allowed=rule.allowed, resolved=rule.resolved)
    for height, last in ((0.5 * rule.allowed, True), (4.0 * rule.allowed, False)):
        masses = Masses(np.random.default_rng(3), 1, 3)
        masses.a *= -9.81 / masses.problem.acceleration[0]
        speed = math.sqrt(2.0 * 9.81 * height * 0.5) / 0.5
        masses.v *= -speed / masses.problem.rate[0]
        log = np.zeros((1, 12))
        on, rests = np.zeros((2, 1), dtype=bool)
        done = instant.impact_of_all(
            masses.problem, limits, 0, Instant(0.0, np.zeros(2), masses.v), log, 0, on, rests
        )
        assert log[0, instant.ENDS] == last
        assert [done.rests, *rests] == [last, last]
        after = masses.problem.rate[0]
        if last:
            assert after == pytest.approx(0.0, abs=1e-15)
            assert log[0, instant.LEFT] == pytest.approx(2.0 * 0.5 * speed / 9.81 / (1.0 - 0.5))
        else:
            assert after == pytest.approx(0.5 * speed)
            assert done.horizon == pytest.approx(100.0 * 2.0 * after / 9.81)


def test_a_bounce_that_would_not_clear_the_violated_gap_is_the_last():
    """What rebounds at -depth and falls at g is highest at ``v^2/(2 g) - depth``."""
    depth, g = 1e-6, 9.81
    for top, last in ((-0.5 * depth, True), (2.0 * depth, False)):
        masses = Masses(np.random.default_rng(3), 1, 3)
        masses.q = -depth * masses.J[0] / (masses.J[0] @ masses.J[0])
        masses.a *= -g / masses.problem.acceleration[0]
        masses.v *= -math.sqrt(2.0 * g * (top + depth)) / 0.5 / masses.problem.rate[0]
        log, (on, rests) = np.zeros((1, 12)), np.zeros((2, 1), dtype=bool)
        now = Instant(0.0, np.zeros(2), masses.v)
        instant.impact_of_all(masses.problem, LIMITS, 0, now, log, 0, on, rests)
        assert log[0, instant.ENDS] == last


def block(slope, mu, slip=0.0):
    """A block of 2 kg on a slope, in contact: x along it, y away from it."""
    masses = Masses(np.random.default_rng(0), 1, 2, friction=mu)
    masses.M, masses.J = np.full(2, 2.0), np.array([[0.0, 1.0], [1.0, 0.0]])
    masses.a = 9.81 * np.array([-math.sin(slope), -math.cos(slope)])
    masses.v = np.array([slip, 0.0])
    return masses.problem


def rested(c, modes, given=None, booked=0, touching=None):
    """Results of `come_to_rest`: it, modes, starts of slip, drawn gaps, the log."""
    m = len(c.value)
    modes, begins, drawn = np.array(modes), *np.zeros((2, m), dtype=bool)
    given = np.zeros(m, dtype=np.int64) if given is None else np.array(given)
    all_of, row = np.ones(m, dtype=bool), np.zeros((booked, 12))
    drives = np.zeros(c.drive_response.shape[1])
    touching = all_of if touching is None else touching
    c.closed[:] = modes > instant.FLIES
    rest = instant.come_to_rest(
        c, LIMITS, Resting(touching, touching, given), drives, row, modes, begins, drawn
    )
    assert (c.closed == (modes > instant.FLIES)).all()
    return rest, modes.tolist(), begins.tolist(), drawn.tolist(), row


def test_a_block_on_a_slope_sticks_slides_and_lifts():
    on, none = np.array([True]), np.zeros(1, dtype=np.int64)
    for slope, grip in ((0.29, STICK), (0.292, BACKWARD), (-0.29, STICK), (-0.292, FORWARD)):
        assert instant.press(block(slope, 0.3), LIMITS, on, none)[0].tolist() == [grip]
    assert math.tan(0.29) < 0.3 < math.tan(0.292)
    assert instant.press(block(0.29, 0.3, 1.0), LIMITS, on, none)[0].tolist() == [FORWARD]
    given = np.array([-1])
    assert instant.press(block(0.29, 0.3), LIMITS, on, given)[0].tolist() == [BACKWARD]
    assert instant.press(block(math.pi, 0.3), LIMITS, on, none)[0].tolist() == [OPEN]


def test_what_closed_contacts_draw_in_is_told_from_what_comes_back():
    masses = Masses(np.random.default_rng(1), 3, 3)
    masses.J, masses.M = np.eye(3), np.ones(3)
    masses.v, masses.a = np.array([0.0, 1e-3, 0.0]), np.array([-1.0, -4.0, 1.0])
    drawn, horizon = instant.induced_closures(masses.problem, LIMITS, np.zeros(3, dtype=bool))
    assert drawn.tolist() == [True, False, False]
    assert horizon == pytest.approx(100.0 * 2.0 * 1e-3 / 4.0)
    known = np.array([True, False, False])
    assert not instant.induced_closures(masses.problem, LIMITS, known)[0].any()
    masses.closed[:] = True
    assert not instant.induced_closures(masses.problem, LIMITS, np.zeros(3, dtype=bool))[0].any()


def test_hypotheses_have_codes():
    assert [h.code for h in Hypothesis] == [0, 1, 2]


@pytest.mark.parametrize(
    ('slope', 'slip', 'mode', 'begins'),
    [
        (0.29, 0.0, instant.STICKS, False),
        (0.30, 0.0, instant.SLIDES_BACKWARD, True),
        (-0.30, 0.0, instant.SLIDES_FORWARD, True),
        (0.29, 1.0, instant.SLIDES_FORWARD, False),
        (0.29, -1.0, instant.SLIDES_BACKWARD, False),
        (math.pi, 0.0, instant.FLIES, False),
    ],
)
def test_a_block_is_told_what_it_does_and_how_it_accelerates(slope, slip, mode, begins):
    before = instant.FLIES if mode != instant.FLIES else instant.STICKS
    c = block(slope, 0.3, slip)
    rest, modes, beginning, drawn, _ = rested(c, [before])
    assert rest.solved
    assert (modes, beginning, drawn) == ([mode], [begins], [False])
    assert (rest.changed, rest.begins) == (True, begins)
    assert (rest.parts, rest.draws) == (mode == instant.FLIES, False)
    direction = {instant.SLIDES_FORWARD: 1, instant.SLIDES_BACKWARD: -1}.get(mode)
    pull, press = -9.81 * math.sin(slope), 9.81 * math.cos(slope)
    along = 0.0 if mode == instant.STICKS else pull - 0.3 * press * (direction or 0)
    away = 0.0 if direction or mode == instant.STICKS else -press
    assert c.acceleration == pytest.approx([away, along], abs=1e-12)
    assert not rested(block(slope, 0.3, slip), [mode])[0].changed


def test_what_comes_to_rest_off_zero_is_to_be_moved_there_and_its_loss_is_booked():
    for shift, speed, off in ((0.0, 0.0, False), (-1e-13, 0.0, True), (0.0, -1e-9, True)):
        c = block(0.0, 0.0)
        c.value[0], c.rate[0] = shift, speed
        rest, modes, _, _, log = rested(c, [instant.FLIES], booked=1)
        assert (modes, rest.off) == ([instant.FOLLOWS], off)
        assert log[0, instant.LOSS] == pytest.approx(0.5 * 2.0 * speed**2, rel=1e-9)
    slow = 0.5 * LIMITS.still
    rest, modes, _, _, log = rested(block(0.1, 0.3, slow), [instant.FLIES], booked=1)
    assert (modes, rest.off) == ([instant.STICKS], True)
    assert log[0, instant.LOSS] == pytest.approx(0.5 * 2.0 * slow**2)


def test_contacts_that_press_each_other_draw_in_what_touches_them():
    """A bar on three supports in a row, of which the middle one touches and is not asked."""
    masses = Masses(np.random.default_rng(1), 3, 2)
    masses.M, masses.J = np.ones(2), np.array([[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]])
    masses.v, masses.a = np.zeros(2), np.array([-9.81, 0.0])
    ends = np.array([True, False, True])
    modes = [instant.FLIES] * 3
    rest, found, _, drawn, _ = rested(masses.problem, modes, touching=ends)
    assert found == [instant.FOLLOWS, instant.FLIES, instant.FOLLOWS]
    assert not rest.draws  # it is at rest with them
    c = masses.problem
    rest, found, _, drawn, _ = rested(c, modes, touching=np.array([True, False, False]))
    assert found == [instant.FOLLOWS, instant.FLIES, instant.FLIES]
    assert (rest.draws, drawn) == (True, [False, True, True])  # it falls around the first
    assert c.acceleration == pytest.approx(masses.J @ (masses.a + masses.J[0] * 9.81 / 2.0))


def test_what_is_closed_strikes_nobody_by_a_step_s_error():
    masses = Masses(np.random.default_rng(4), 2, 4, friction=0.3)
    masses.J = np.eye(4)[[0, 2, 1, 3]]
    masses.v = np.array([-1.0, 0.2, -0.5 * LIMITS.still, 0.3 * LIMITS.still])
    masses.closed[1] = True
    before, log = masses.v.copy(), np.zeros((2, 12))
    touching, resting = np.zeros((2, 2), dtype=bool)
    done = instant.impact_of_all(
        masses.problem, LIMITS, 0, Instant(0.0, np.zeros(2), masses.v), log, 0, touching, resting
    )
    assert (done.entered, log[0, instant.GAP]) == (1, 0.0)
    assert (masses.v[2:] == before[2:]).all()
    assert resting.tolist() == [False, True]


def test_slips_begin_together_as_far_as_they_are_independent():
    """Rank by singular values is the second route."""
    rng = np.random.default_rng(5)
    counts = []
    for n in range(60):
        m = 3
        masses = Masses(rng, m, 4, friction=0.3)
        if n % 2:
            masses.J[m + 1] = masses.J[m] + masses.J[0]
        masses.v[:] = 0.0
        grips, kept = np.full(m, FORWARD), np.zeros(2 * m, dtype=bool)
        kept[0] = True
        begins = instant.begin(masses.problem, LIMITS, grips, kept)
        rows = masses.J[kept] / np.sqrt(masses.M)
        assert kept.tolist() == [True, False, False, *begins]
        assert np.linalg.matrix_rank(rows, tol=1e-6) == len(rows)
        every = masses.J[[0, *range(m, 2 * m)]]
        assert np.linalg.matrix_rank(every, tol=1e-6) == len(rows)
        counts.append(len(rows))
    assert set(counts) == {3, 4}


def test_terms_in_a_row_are_read_as_they_were_written():
    given = Masses(np.random.default_rng(2), 2, 5, friction=0.2).problem
    row = np.concatenate([np.ravel(x) for x in given[:9]])
    layout = instant.Layout(2, 4, 5, 2, 0)
    assert layout.size == len(row)
    laws = np.array([given.restitution, given.friction])
    read = problem_of(ContactArrays(row, layout, laws, given.closed, given.hypothesis))
    for x, y in zip(read, given, strict=True):
        assert x.shape == y.shape
        assert (x == y).all()


def test_modes_become_flags():
    modes = np.array([1, 2, 3, 4, 5, 6])
    places = np.arange(24).reshape(4, 6)
    flags = np.full(24, np.nan)
    write_flags(modes, np.zeros(0, dtype=bool), places, flags)
    closed, sticks, slips, presses = flags.reshape(4, 6).tolist()
    assert closed == [0, 1, 1, 1, 1, 1]
    assert sticks == [0, 0, 1, 0, 0, 0]
    assert slips == [0, 0, 0, 1, -1, 0]
    assert presses == [0, 1, 1, 1, 1, 0]
    places[:, 3] = -1
    flags[:] = np.nan
    write_flags(modes, modes == Mode.SLIDING_BACKWARD, places, flags)
    assert flags.reshape(4, 6)[:, 4].tolist() == [1, 1, 0, 1]
    assert np.isnan(flags.reshape(4, 6)[:, 3]).all()


@pytest.mark.slow
@pytest.mark.usefixtures('plain_kernels')
def test_a_long_run_has_the_same_bits_when_its_kernels_are_compiled(compiled_kernels):
    scene = ms.load_scene('four_bar_clearance', {'start': 'centred'})
    plain = ms.simulate(scene, revolutions=5.0)
    assert len(plain.impacts) > 150
    compiled_kernels()
    assert ms.simulate(scene, revolutions=5.0).digest() == plain.digest()
    assert run_row.codes


@pytest.mark.slow
@pytest.mark.usefixtures('plain_kernels')
def test_runs_have_the_same_bits_when_kernels_are_compiled(compiled_kernels):
    """With friction, and with more gaps without: stick, slip, rest and release."""
    two, joints = ('crank_coupler', 'coupler_rocker'), ('ground_crank', 'rocker_ground')
    scenes = [
        ms.load_scene('four_bar_clearance', {'start': 'centred'} | {
            f'joints.{joint}.clearance': {'radial': '0.2 mm', 'restitution': 0.5, 'friction': mu}
            for joint in loose
        })
        for loose, mu in ((two, 0.2), ((*two, *joints), 0.0))
    ]  # fmt: skip
    plain = [ms.simulate(scene, revolutions=0.5) for scene in scenes]
    assert min(len(run.impacts) for run in plain) > 20
    compiled_kernels()
    for scene, run in zip(scenes, plain, strict=True):
        assert ms.simulate(scene, revolutions=0.5).digest() == run.digest()


@pytest.mark.usefixtures('plain_kernels')
def test_the_equations_are_told_the_modes_that_hold(monkeypatch):
    """After every event, contacts that begin to slide among them."""
    clearance = {'radial': '0.2 mm', 'restitution': 0.5, 'friction': 0.1}
    joints = ('crank_coupler', 'coupler_rocker')
    machine = ms.load_scene(
        'four_bar_clearance', {f'joints.{joint}.clearance': clearance for joint in joints}
    )
    run, system = machine.start(), machine.equations.system
    now = respond.come_to_rest
    seen = []
    monkeypatch.setattr(respond, 'come_to_rest', lambda *x: seen.append(now(*x)) or seen[-1])
    places = np.array(
        [system.parameters.closed, system.parameters.sticks, system.parameters.slips, [-1, -1]]
    )
    for _ in range(400):
        run.advance(1.0, most=1)
        wanted = np.array(run._pars)
        write_flags(np.array(run._gaps.modes), np.zeros(0, dtype=bool), places, wanted)
        assert (wanted == np.array(run._pars)).all()
    assert sum(rest.begins for rest in seen) > 3
