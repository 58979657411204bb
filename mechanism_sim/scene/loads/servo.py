"""Servos: a force or a torque that brings a length or an angle to a target, by P, PD or PID."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import Reference
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Part, si_of
from mechanism_sim.numerics.expressions import parse
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.formula_keys import check_formula, or_formula
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements
from mechanism_sim.scene.loads.spring import Placing, SpringPart
from mechanism_sim.scene.loads.state import formula_state
from mechanism_sim.units import QuantityValue, alike

_INTEGRAL = 'integral'
_TARGETS = 'target', 'target_rate'
_NOTHING = QuantityValue(0.0, '')


class _ServoSpring(SpringPart):
    """The force of a servo, as a spring whose force is a formula."""

    section: ClassVar[str] = 'servos'


class ServoPart(ElementKeys):
    """A controller: ``p e + i integral(e) + d e'`` with the error e, within a limit.

    While it is at its limit, its integral follows with the time constant p/i (tracking: K. Åström
    and T. Hägglund, "PID Controllers", 1995, section 3.5), so that it does not wind up.
    """

    between: Reference | None = None
    """Two links, whose angle, or two points, whose distance it brings to the target."""
    coordinate: str | None = None
    """Instead of these a link, whose displacement in its guide, or angle, it does."""
    target: Annotated[QuantityValue | str, or_formula('rad', 'm')]
    """An angle or a length, or a formula of t, states and links."""
    target_rate: Annotated[QuantityValue | str, or_formula('rad/s', 'm/s')] = _NOTHING
    """Rate of the target, which `d` compares with that of the motion."""
    p: Annotated[QuantityValue, si_of('N m/rad', 'N/m')]
    """Effort per error."""
    i: Annotated[QuantityValue, si_of('N m/rad/s', 'N/m/s')] = _NOTHING
    """Effort per integral of the error; this is the state NAME.integral."""
    d: Annotated[QuantityValue, si_of('N m s/rad', 'N s/m')] = _NOTHING
    """Effort per rate of the error."""
    limit: Annotated[QuantityValue, si_of('N m', 'N')] | None = None
    """Largest effort, either way."""

    @property
    def _turns(self) -> bool:
        return self.p.unit == 'N m/rad'

    def states(self, name: str) -> dict[str, str]:
        """Integral of the error with its unit, if the controller has an integral term."""
        return {f'{name}.{_INTEGRAL}': 'rad s' if self._turns else 'm s'} if self.i.value else {}

    def _spring(self, name: str = '') -> _ServoSpring:
        """Force of the controller, by names of its own, or those that the whole scene knows."""
        effort = self._efforts('', name)[0]
        kind = 'torque' if self._turns else 'force'
        place = {'between': self.between, 'coordinate': self.coordinate}
        return _ServoSpring.model_validate({**place, kind: f'0 - ({effort})'})

    def _efforts(self, own: str, name: str) -> tuple[str, str, str]:
        """Formulas of its effort, of the same without limits, and of the error.

        Parameters
        ----------
        own : what stands before its own length or angle and rate
        """
        said, of = self._said, 'rad' if self._turns else 'm'
        target, pace = said(self.target, of), said(self.target_rate, f'{of}/s')
        error = f'({target} - {own}{"angle" if self._turns else "length"})'
        wanted = f'{said(self.p)}*{error}'
        if self.d.value:
            wanted += f' + {said(self.d)}*({pace} - {own}rate)'
        if self.i.value:
            wanted += f' + {said(self.i)}*{name}.{_INTEGRAL}'
        if not self.limit:
            return wanted, wanted, error
        limit = said(self.limit)
        return f'min({limit}, max(0 - {limit}, {wanted}))', wanted, error

    @property
    def _have_units(self) -> dict[str, bool]:
        """True of each of its own formulas, by key, that has any."""
        formulas = {key: x for key in _TARGETS if isinstance(x := getattr(self, key), str)}
        return {
            key: not all(alike(n.unit or '', '') for n in parse(x, None).walk())
            for key, x in formulas.items()
        }

    def _said(self, x: QuantityValue | str, unit: str = '') -> str:
        """A value or a formula as a part of another formula."""
        if isinstance(x, str):
            return f'({x})'
        with_unit = any(self._have_units.values())  # then all of the effort must have them
        return f'({x.value!r} {x.unit or unit})' if with_unit else f'({x.value!r})'

    def placed(self, places: Names, name: str, tree: Mechanism) -> Placing:
        """Points of action of the controller's force."""
        return self._spring(name).placed(places, name, tree)

    def measures(self, places: Names, name: str, tree: Mechanism) -> dict[str, str]:
        """Names behind its own in formulas, with units."""
        return self._spring(name).measures(places, name, tree)

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """Read the force of the controller and its integral."""
        where = f'servos.{name}'
        self._check(where, name)
        unit = 'rad' if self._turns else 'm'
        for key, per in zip(_TARGETS, ('', '/s'), strict=True):
            if isinstance(text := getattr(self, key), str):
                check_formula(places, f'{where}.{key}', text, f'{unit}{per}', tree, {})
        have = self._have_units
        try:
            force = self._spring(name).read(places, name, tree)
        except InputError as wrong:
            if {*have.values()} != {True, False}:
                raise
            # each of them was right by itself
            some, none = sorted(have, key=have.__getitem__, reverse=True)
            raise InputError(
                f'{where}.{some} has units, but {where}.{none} has none: give both formulas with '
                'units, or both without'
            ) from wrong
        if not self.i.value:
            return force
        effort, wanted, error = self._efforts(f'{name}.', name)
        rate = f'{error} + ({effort} - ({wanted}))/{self._said(self.p)}' if self.limit else error
        (state,) = self.states(name)
        integral = formula_state(places, tree, state, f'{unit} s', 0.0, 1.0, rate)
        return lambda mechanism: [*force(mechanism), *integral(mechanism)]

    def _check(self, where: str, name: str) -> None:
        """Refuse quantities that do not fit together."""
        if not name.isidentifier():
            raise InputError(f"{where}: the name '{name}' must be letters, digits and _")
        if not self.p.unit:
            raise InputError(f"{where}.p needs its unit, '20 N m/rad' or '20 N/m'")
        for key in ('i', 'd', 'limit', *_TARGETS):
            given = getattr(self, key)
            unit = given.unit if isinstance(given, QuantityValue) else ''
            if unit and ('rad' in unit or unit == 'N m') != self._turns:
                raise InputError(
                    f'{where}.{key} is in {unit}, but p in {self.p.unit}: give all of an angle '
                    "('20 N m/rad'), or all of a length ('20 N/m')"
                )
        if not self.p.value > 0.0 or min(self.i.value, self.d.value) < 0.0:
            raise InputError(f'{where}: p must be above 0, i and d not below')
        if self.limit and not self.limit.value > 0.0:
            raise InputError(f'{where}.limit = {self.limit.value:g} must be above 0')


@LOADS.add('servos')
class Servos(Part):
    """The servos of a scene."""

    servos: dict[str, ServoPart] = Field({})
    """Controllers of angles and lengths, by name."""
