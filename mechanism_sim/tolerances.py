"""Every tolerance, scale and limit of the engine, each with its reason and what it is relative to.

They are groups by the part of the engine that reads them: `TOLERANCES.guards.hold`. A group is a
tuple, so that compiled kernels can read it: its values are constants of their machine code.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

_EPSILON = sys.float_info.epsilon


class RoundingTolerances(NamedTuple):
    """Errors of double precision, from a single operation up to what a solve leaves."""

    #: share of a number
    epsilon: float = _EPSILON
    #: share of the sum of magnitudes, of some ten terms
    sum: float = 8.0 * _EPSILON
    #: share of the largest term of a Fourier sum
    series: float = 16.0 * _EPSILON
    #: share of the largest term of a loop closure: a chain of rotations
    closure: float = 32.0 * _EPSILON
    #: share of the largest value of its kind: what differs by less is equal; likewise a pivot
    value: float = 1e-13
    #: share of the sum of magnitudes of ``A x + b`` with a solved x: less is zero
    solved: float = 1e-12
    #: share of the largest acceleration, whose mass matrix was solved for and whose terms cancel
    acceleration: float = 1e-9
    #: divisor in the place of a size that may be zero
    least: float = 1e-300


class ComplementarityTolerances(NamedTuple):
    """Lemke's method for scaled problems, whose entries are about 1."""

    #: least pivot that is not rounding of an exchanged entry
    pivot: float = 1e-11
    #: ratios that differ by less are equal, and lexicographic order decides
    tie: float = 1e-13
    #: share of the sum of magnitudes in a row: a solution leaves no more over
    exact: float = 1e-9
    #: share of the rates: largest change by friction beyond its cone by a pivot's rounding
    cone: float = 1e-10
    #: share of the largest impulse: a smaller one is none
    impulse: float = 1e-14
    #: share of the first pivot: the row depends on those before it
    dependent: float = 1e-10
    #: share of the product of the diagonal: a smaller determinant is that of dependent rows
    regular: float = 1e-12
    #: least reciprocal of a coefficient of friction while pivoting: the mild one first
    weakest: tuple[float, float] = (1e-3, 1e-5)
    #: covering vectors that are tried before there is said to be no solution
    covers: int = 3


class ImpactTolerances(NamedTuple):
    """Impacts, and impacts without collision."""

    #: square of the sine of the angle to the rows before: a nearer row depends on them
    independent: float = 1e-8
    #: the same of a slip: the closed gaps determine it, for less would be rounding of its friction
    determined: float = 1e-12
    #: share of the diagonal's geometric mean: difference of equal coupling terms by rounding
    symmetric: float = 1e-13
    #: compliance of a slip over that of its normal: with less the links cannot change it
    prescribed: float = 1e-16
    #: Coulomb's coefficient of rough contacts while they stay closed; in impacts it is infinite
    rough: float = 1e4
    #: times its friction, what is about to jam jams
    firmer: float = 1.0 + 1e-4
    #: share of the time in which accelerations would make the slip: a step of no length
    instant: float = 1e-6
    #: share of the slip: an impact without collision that changes no rate by more frees nothing
    frees: float = 1e-9
    #: share of the largest normal impulse: smaller tension is rounding of a null vector
    pull: float = 1e-6
    #: share of the largest change of a slip along that vector: a slower one does not stop
    stops: float = 1e-12
    #: share of the largest singular value: rank of the equations of a shock, and at the very jam
    shock_rank: float = 1e-13
    jam_rank: float = 1e-14
    #: share of the rate before: a contact that parted by rounding in a shock is still at rest
    parted: float = 1e-6
    #: share of the approach: a rebound that is not faster is none
    rebound: float = 1e-9
    #: share of the largest impulse: change at which iteration with joint friction has converged;
    #: where rounding goes on turning a slip over, the rough bound counts after `joint_rounds`
    joint: float = 1e-13
    joint_rough: float = 1e-9
    joint_rounds: int = 200


class JointImpulseTolerances(NamedTuple):
    """Projected Gauss-Seidel iteration for friction impulses in ideal joints."""

    #: share of the largest bound: a smaller change ends the iteration
    settled: float = 1e-15
    sweeps: int = 10_000
    #: share of the change before: a larger one is not settling, and the step to a bound is halved
    grows: float = 0.95
    least_step: float = 0.02


class ChatterTolerances(NamedTuple):
    """Cut-off of Zeno chatter, see `contact.chatter.ChatterRule`."""

    #: share of rtol: displacement by rebounds left out, over the size, as small as steps' errors
    step_error: float = 0.01
    #: share of the size: least displacement left out, unless rtol is less
    least: float = 1e-12
    #: of a speed: where a rebound loses less, flights go on alike, until they rise no more than
    #: so many times what can be told from rounding
    elastic: float = 0.01
    roundings: float = 500.0
    #: flights that fall back steadily, whose time the next step does not exceed: a root much
    #: nearer to its start than to its end gets lost
    flights: float = 100.0


class ContactTolerances(NamedTuple):
    """Contacts at an event, and compliant contacts."""

    #: roundings of the largest position: gaps smaller than so many count as closed
    touching: float = 4.0
    #: share of the size of the machine, at most: gaps so near take part in the same impact
    tie: float = 1e-9
    #: spacings of the fastest speed: rate that an impact leaves by rounding
    bare: float = 1e3
    #: share of rtol and of the fastest speed, but of the latter at least the second: a step's
    #: error; what is slower is at rest
    still: float = 0.01
    still_least: float = 1e-12
    #: [N] by which rounding may leave a contact outside of its friction cone, and the same as a
    #: share of weights and inertia forces: the smaller of them
    cone_force: float = 1e-9
    cone_share: float = 1e-7
    #: roundings of a guard: one that fell farther did not fall at the same instant
    same_instant: float = 1e3
    #: events at one instant: what then falls at rest does so by rounding
    again: int = 2
    #: share of the friction bound, by which a slip that other contacts hold stays within
    held_slip: float = 1e-9
    #: gaps at rest beside joint friction up to which all combinations of modes are tried
    enumerated: int = 4
    #: impacts without collision at one instant
    jams: int = 6
    #: share of the fastest speed: to no slower touch does the damping of a compliant contact refer
    slowest_touch: float = 1e-6
    #: [m] depth at which a compliant contact begins, for its force has no series at zero, and the
    #: same as a share of the size: the smaller of them, but not less than `touching`
    inside: float = 1e-13
    inside_share: float = 1e-12
    #: share of the speed that its load makes: what touches slower is loaded from rest
    set_down: float = 0.01
    #: [m/s] sliding speed below which the direction of an oil film's flow is undefined
    film_rest: float = 1e-12
    #: share of the normal impulses times their approach, which impacts may create by rounding
    energy_gain: float = 1e-12
    #: imaginary part of a root in [-1, 1] that is real but for rounding
    real_root: float = 1e-9
    #: share of the clearance: a pin so near to the centre has no direction
    central: float = 1e-6


class GuardTolerances(NamedTuple):
    """Scales of the functions whose zeros are events: none may rule the size of the steps."""

    #: keeps a guard off exact zero, from where the integrator would never fire it
    tiny: float = 1.0625e-300
    #: [m/N] of forces, and weight and inertia forces at 1 rad/s [N] below which it is more
    force_scale: float = 1e-6
    light: float = 1e-4
    #: [s] of tangential velocities
    slip_scale: float = 1e-3
    #: [m] of the margin to jamming
    jam_scale: float = 1e-6
    #: scale of states that are integrated to be watched only
    watch_scale: float = 1e-30
    #: times its friction, sticking gives way: beyond the rounding of forces
    hold: float = 1.0 + 1e-10
    #: margin to jamming, 1 without friction, at which contacts count as jammed
    jammed: float = 1e-4
    #: that of rough contacts, which jam a little earlier than those of a large coefficient
    jammed_rough: float = 0.1
    #: that of friction in ideal joints
    joint_jammed: float = 1e-3
    #: value of a guard below which a root may be near at any rate
    near_root: float = 1e-12


class JointFrictionTolerances(NamedTuple):
    """Set-valued forces: friction in ideal joints, loads that step against a motion."""

    #: share of the weight of all links on Earth: a smaller force in a joint makes no friction
    resolution: float = 1e-9
    #: share of the resolution: no bound is exactly zero
    off_zero: float = 1e-3
    #: added to a coefficient, which may be zero for a while: a quotient needs a denominator
    coefficient: float = 1e-6
    #: times the resolution: the law's residual is measured by no smaller bound
    bound: float = 1e3
    #: Newton steps: an error x relative to the bounds leaves k x^2, k the coefficient times radius
    #: over the length of a link; below k = 0.3 the last one leaves a rounding
    newton: int = 5
    #: share of its bound: friction farther from its law is refused
    residual: float = 1e-9
    #: determinant of the equations of inverse dynamics, 1 without friction, at which they lock
    locked: float = 1e-6
    #: coefficient of what slides without friction for a part of its cycle
    idle: float = 1e-30
    #: determinant, with rows whose largest entry is 1, of switches that depend on each other
    dependent: float = 1e-9
    #: change of a part, 0 to 1, at which Gauss-Seidel iteration for switches has converged
    settled: float = 1e-14
    sweeps: int = 1000


class SwitchTolerances(NamedTuple):
    """Switches of loads, tables and friction, by functions of about 1."""

    #: how far past zero a switch turns over: as far the other way is the next time
    margin: float = 1e-12
    #: share of its length: a table that is not periodic allows for rounding at its ends
    table_end: float = 1e-9
    #: [rad] before a tooth where a pawl counts as on it
    tooth: float = 1e-12
    #: size of a function of rates that is as good as zero: what steps there may hold a motion
    rest: float = 1e-10
    #: [1/s] rate of such a function: a force that changes it by less steps nowhere
    felt: float = 1e-9
    #: share of its own jump: below, others hold a switch's rate
    own: float = 1e-6
    #: [s] between turns of a switch at one place, of which so many in a row are an error
    again: float = 1e-6
    turns: int = 1000


class StepTolerances(NamedTuple):
    """Taylor steps and the search for events in them."""

    #: share of the fastest drive: rate whose relative error is rtol
    rate: float = 0.1
    #: share of a step that missed an event: off the powers of two, at which root searches bisect
    shorter: float = 0.37
    #: share of the longest step: no step is halved further
    shortest: float = 1e-12
    #: order of the series of steps that an event ends soon
    low_order: int = 7
    #: share of a step's error: last terms of rates in such steps
    low_error: float = 1e-3
    #: events until which such steps save less than they cost to compile
    short_from: int = 500
    #: times the fastest drive: rate at which errors of gaps and loops are taken back
    stabilisation: float = 1e3
    #: times a step's error, by which its polynomials may be off the equations
    defect: float = 1e3
    #: value of a guard: below zero by more, and below its own series, it has fallen unseen
    fallen: float = 1e-10
    #: value of a guard over the share of a step: a smaller change makes no event
    guard: float = 1e-12
    #: share of the limit of the defect: a change of a rate that nothing needs to find
    unfelt: float = 1e-4
    #: share of the size of the machine: distance at which the ends of a force element meet
    meet: float = 1e-6
    #: share of a state, and as an absolute value: if a formula has no value there, it ends here
    beside: float = 1e-9
    #: steps in a row that are shorter than the time rounds, after which a run is at its end
    stalled: int = 8
    #: multiple of its scale: size of a diverging state of first order; squared, of its rate
    endless: float = 1e6
    #: events at one instant, after which the run is said to make no progress
    simultaneous: int = 100
    #: times the shortest step, within which so many follow each other that it makes none, either
    crowd: float = 10.0
    crowded: int = 300
    #: steps after which cosine and sine of steady drives are computed anew
    row: int = 64


class FilmTolerances(NamedTuple):
    """Oil films whose damping makes steps short."""

    #: steps between two looks
    look: int = 8192
    #: steps still to come, from which on a run is spoken of, and its film: some minutes
    many: float = 1e7
    #: steps still to come of a film that is squeezed out at standstill, which nobody waits for:
    #: they take hours to days
    endless: float = 1e9
    #: rate times step: what decays slower does not limit an explicit step, whose limit is near 9
    rules: float = 1.0
    #: share of the power that a fast decay takes, a ruptured film takes half on one side
    share: float = 0.3
    #: [m/s or rad/s] change of a speed that shows the damping of a film, which is slower
    nudge: float = 1e-3
    #: share of the clearance: a thicker film is stiff by its oil, not by its thickness
    centred: float = 0.5
    #: [m] thickness at which there is no oil but some molecules
    molecules: float = 1e-9
    #: share of its growth: ``h^(-3/2)`` grows so evenly where a steady load squeezes a film
    even: float = 0.1
    #: multiple of the speed at which a film gets thinner: links of a machine at rest are
    #: hardly faster, by their levers
    standstill: float = 100.0


class SingularityTolerances(NamedTuple):
    """Passing positions where closures depend on each other; distances are 0 to 1."""

    #: steps ahead in which the tangent of the distance's root may foresee a singular position
    ahead: float = 3.0
    #: share of a regular step: where the step across begins before the position. Farther away its
    #: polynomial is less exact; nearer, rounding grows with the inverse square of the way
    zone: float = 0.25
    #: length of the step across by the way to the position: errors grow as its powers
    beyond: float = 1.2
    #: times that the tangent of the distance's root may put the position too far away
    tangent: float = 1.6
    #: part of a stride by which the next may be shorter without a cause
    slower: float = 0.9
    #: share of the distance at the start of a step: a smaller minimum is a zero
    touches: float = 1e-5
    #: share of the speed: largest error of a step across
    decided: float = 1e-6
    #: share of the largest distance so far, at which branches can still be told apart
    narrow: float = 1e-9
    #: distance below which a motion starts at a singular position
    here: float = 1e-10
    #: distance at which a motion goes on otherwise than it came: nearer, steps suffer by rounding
    beside: float = 1e-8
    #: distance at which a joint is named singular in a message
    named: float = 1e-6
    #: [rad, or lengths of the mechanism] before a singular start where its first step begins
    first: float = 0.05
    #: share of the start's state: so near the first step must lead through it; Newton ends earlier
    start: float = 1e-9
    start_newton: float = 1e-14
    start_rounds: int = 30
    #: share of the step across: nearer to the position guards are not evaluated
    blind: float = 0.1
    #: of the largest root of the distance: forces are known there; so far, of a segment, to either
    #: side they are sampled; imaginary part of a root that is real
    away: float = 0.2
    width: float = 0.45
    real_root: float = 1e-6


class AuditTolerances(NamedTuple):
    """Violations of a finished motion beyond which the run is refused."""

    #: [m] deeper than what is measured already: not worth a closer look
    depth: float = 1e-14
    #: of the largest normal force, [N] at least the second: pull that a step's error may leave
    pull: float = 1e-3
    pull_least: float = 1e-12
    #: share of the longest step so far: shorter tension is negligible. Switch rows follow from
    #: places, so that a step between two events of one instant may be seen with those before it
    pull_lasts: float = 1e-9
    #: share of the energy exchanged: more missing is no error of integration
    missing: float = 0.01
    #: roundings of an energy where it is evaluated
    evaluated: int = 64
    #: share of the kinetic energy: near singular positions a torque of zero is known no better
    conditioned: float = 1e-11
    #: [1/s] of rates, in a step of usual tolerance, which refers to 1 rad/s at least
    step_error: float = 1e-13
    #: share of the energy exchanged: if more is missing it is said
    noticed: float = 1e-6
    #: share of the energy exchanged: works may be off by that without a word about it
    promised: float = 1e-9
    #: share of the rates: between two steps of no impact they differ by rounding only
    jump: float = 1e-9


class QuadratureTolerances(NamedTuple):
    """Integrals, and functions as polynomials on halved intervals."""

    #: error aimed at, of the integral of the magnitude, or of the largest magnitude so far
    relative: float = 1e-10
    #: likewise where functions are foretold: their estimates exceed their errors by orders
    foretold: float = 1e-9
    #: of the largest mean magnitude so far times the interval: smaller errors are rounding of
    #: larger terms, which no halving removes
    negligible: float = 1e-12
    #: share of an interval's error, that may be at one jump or corner in it
    corner: float = 1.0 / 64.0
    #: share of the error aimed at: where parts were needed, no smaller estimate is believed
    believed: float = 0.5
    #: times the coefficients left out, errors are estimated
    safety: float = 4.0
    #: halvings, after which an interval is a point
    halvings: int = 48
    #: unresolved parts of an interval: a feature leaves few of one depth, noise all
    parts: int = 32
    #: below minus the first exp is zero but for rounding, beyond the second tanh is constant,
    #: beyond the third exp overflows
    exp_zero: float = 60.0
    tanh_constant: float = 20.0
    exp_infinite: float = 710.0
    #: change of an argument, or ratio of a divisor, over which few nodes find a function
    steady: float = 4.0
    #: share of the range of levels: a quantile is known so well
    quantile: float = 1e-15


class ExtremeTolerances(NamedTuple):
    """Search for the extremes of a function of time."""

    #: of the size seen at a few nodes: an extreme found later is not much less; what differs by
    #: less in intervals that are alike is the same there
    glanced: float = 1e-10
    #: share of the range in an interval: then its extreme is off by the square of that
    resolved: float = 1e-8
    #: units in the last place inside an end, where another row of a switch may hold at it
    inset: int = 64
    #: an error of which so much is left in both halves, so many times in turn, is rounding
    less: float = 0.3
    stalled: int = 3
    rounds: int = 2000


class HarmonicTolerances(NamedTuple):
    """Fourier series, and poles of transfer functions."""

    #: share of the largest value: last terms of an expansion that is known
    resolved: float = 1e-13
    #: share of the largest value times the period: an interval that adds no more is done
    small: float = 1e-16
    #: an error of which so much is left in both halves, so many times in turn, is noise
    less: float = 0.5
    stalled: int = 3
    halvings: int = 52
    #: intervals; then the error is what it is, and is reported
    intervals: int = 1 << 16
    #: distance that rounding costs two poles, in units of their size, and its factor by each more
    lost: float = 1e-16
    lost_growth: float = 10.0
    #: [rad/s] how far poles at zero are moved
    at_zero: float = 1e-5


class EnclosureTolerances(NamedTuple):
    """Tolerances of the check whether samples of a piece of motion resolve a formula."""

    #: degree of polynomials of a motion that its Taylor series foretells
    degree: float = 8.0
    #: share of the distance from a pole that an argument may go from the middle of a piece
    pole: float = 0.5
    #: share of the same: there a series converges so fast that its own last terms tell its error
    nearer: float = 0.5
    #: bound of a function in a part that contains its pole
    limitless: float = 1e300
    #: halvings: less than rounding of the place itself; and parts unknown at the same time
    halvings: int = 48
    parts: int = 1024
    #: share of a fault: less is far from one
    sound: float = 0.01
    #: how far a function may go beyond its samples: of what it varies by, and of its size, which
    #: allows for overestimation; and of its variation, how much it may change in one part
    of_range: float = 0.05
    of_size: float = 0.01
    in_part: float = 0.5


class PeakTolerances(NamedTuple):
    """Duration of a peak of load."""

    #: share of the peak: as long as a load is above it, that is the peak
    level: float = 0.5
    #: segments kept before a batch, for peaks that begin there
    kept: int = 512
    #: segments to either side: what lasts longer is no peak but the load
    most: int = 2048
    #: number of divisions into 16 parts, in which its end is located
    rounds: int = 8
    #: spacings of the time, by which a peak may lie outside its segment
    time: float = 256.0


class BranchTolerances(NamedTuple):
    """Branches of a mechanism as polynomials across singular positions; independence is 0 to 1."""

    #: independence of the constraints below which a branch is fitted
    near: float = 0.05
    #: that below which a position is singular but for rounding: Newton's method ends at the root
    #: of rounding from a double point
    singular: float = 1e-5
    #: that below which, at a limit of the drive, rates are those of the polynomials over time:
    #: from positions they follow with the rounding over its square, accelerations over its cube
    limit: float = 1e-3
    #: times what rounding may leave open where a branch is given by its polynomial
    open: float = 4.0
    #: [rad, or lengths of the mechanism] to either side, halved so many times at most
    width: float = 0.3
    halvings: int = 8
    #: times as far as it must be known: also behind a singular position at the end
    behind: float = 1.3
    #: share of the width: samples of less independence do not count
    trusted: float = 1.0 / 15.0
    #: share of the largest singular value: less leaves a motion free
    loose: float = 1e-4
    #: starts that are tried for branches, so far [rad, or lengths] from the position, and the
    #: steepest rate of a link by that of the drive
    tries: int = 48
    step: float = 0.02
    steepest: float = 20.0
    #: tangents that differ by less are of one branch
    same: float = 1e-6
    #: share of the greatest independence: nearer samples of forces do not count
    far: float = 0.1
    #: share of a function's size: a misfit that is smaller is rounding
    misfit: float = 1e-9
    #: share of the largest of its kind: what is smaller is measured by that
    beside: float = 1e-3
    #: of the width: a place not farther from a singular position is at it, by so many iterations
    at: float = 1e-9
    newton: int = 20


class MechanismTolerances(NamedTuple):
    """Kinematics, loads and linear systems of a mechanism."""

    #: share of the largest motion or closure: what moves less along a direction does not move
    no_mass: float = 1e-7
    #: virtual power per size, rate of the drive and size of the machine: below, it is none
    no_work: float = 1e-9
    #: sine of the angle between the axis of a beam and a line that bends with it
    parallel: float = 1e-9
    #: spacings of the largest place: from smaller clearances normals are known to five digits at
    #: most, and rounding rules the length of steps
    least_clearance: float = 2e5
    #: share of its length: what an elastic link bends by is known so well, by 17 times the square
    bends: float = 0.05
    bends_error: float = 0.04
    #: share of the largest stiffness: below, a coordinate is not held
    unheld: float = 1e-11
    #: share of the largest force: along such a coordinate, less is rounding
    force: float = 1e-9
    #: share of a load's largest size in a part: its interpolant may be off by that
    load: float = 1e-8
    #: share of a usual part: shorter ones would never come past a pole
    shortest_part: float = 2.0**-30
    #: Newton iterations for a closed position, in some of which the rest must halve
    closing: int = 60
    patience: int = 8
    #: Newton iterations for an equilibrium
    equilibrium: int = 100
    #: share of a friction bound: its change is found, by so many Newton iterations
    friction_settled: float = 1e-13
    friction_newton: int = 60


class Tolerances(NamedTuple):
    """All groups."""

    rounding: RoundingTolerances = RoundingTolerances()
    complementarity: ComplementarityTolerances = ComplementarityTolerances()
    impacts: ImpactTolerances = ImpactTolerances()
    joint_impulses: JointImpulseTolerances = JointImpulseTolerances()
    chatter: ChatterTolerances = ChatterTolerances()
    contacts: ContactTolerances = ContactTolerances()
    guards: GuardTolerances = GuardTolerances()
    joint_friction: JointFrictionTolerances = JointFrictionTolerances()
    switches: SwitchTolerances = SwitchTolerances()
    steps: StepTolerances = StepTolerances()
    films: FilmTolerances = FilmTolerances()
    singular: SingularityTolerances = SingularityTolerances()
    audit: AuditTolerances = AuditTolerances()
    quadrature: QuadratureTolerances = QuadratureTolerances()
    extremes: ExtremeTolerances = ExtremeTolerances()
    harmonics: HarmonicTolerances = HarmonicTolerances()
    enclosure: EnclosureTolerances = EnclosureTolerances()
    peaks: PeakTolerances = PeakTolerances()
    branches: BranchTolerances = BranchTolerances()
    mechanism: MechanismTolerances = MechanismTolerances()


TOLERANCES = Tolerances()
