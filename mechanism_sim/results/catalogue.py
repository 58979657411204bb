"""The catalogue of a machine: all of its quantities by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.results.quantities.contacts import (
    of_contacts,
    of_force_elements,
    of_readings,
    of_states,
)
from mechanism_sim.results.quantities.forces import of_drives, of_energy, of_joints, of_links
from mechanism_sim.results.quantities.motion import (
    of_coordinates,
    of_elastic_links,
    of_frame,
    of_mass_centre,
    of_points,
    of_points_of_elastic_links,
    of_tilting_joints,
)
from mechanism_sim.results.quantities.shafts import of_shafts
from mechanism_sim.results.quantities.transmission import of_transmission
from mechanism_sim.results.quantity import Quantity, Shown, View, evaluated
from mechanism_sim.scene import Machine
from mechanism_sim.scene.remarks import no_forces
from mechanism_sim.tables import Table
from mechanism_sim.units import plain

SOURCES: tuple[Callable[[Machine], Iterator[Quantity]], ...] = (
    of_coordinates, of_states, of_elastic_links, of_tilting_joints, of_contacts, of_joints,
    of_drives, of_energy, of_points_of_elastic_links, of_readings, of_shafts, of_mass_centre,
    of_frame, of_points, of_links, of_force_elements,
    of_transmission,
)  # fmt: skip
"""Sources of quantities in the order of tables; of equal names the first counts."""

TIME = Quantity('t', 's', 'time', '', lambda view: view.t, counted=True)


def flat(names: str | Iterable[str | Sequence[str]]) -> Iterator[str]:
    """Names that are given one by one or in lists."""
    if isinstance(names, str):
        yield names
    elif isinstance(several := plain(names), Iterable) and not isinstance(several, bytes):
        for name in several:
            yield from flat(name)
    else:
        raise InputError(f'expected the name of a quantity, got {quoted(names)}')


class Catalogue(Mapping[str, Quantity]):
    """The quantities of a machine by name.

    Parameters
    ----------
    machine : machine of the quantities
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._known = {TIME.name: TIME}
        for source in SOURCES:
            for quantity in source(machine):
                self._known.setdefault(quantity.name, quantity)

    def __getitem__(self, name: str) -> Quantity:
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def shown(self, least: Shown) -> list[str]:
        """Names of the quantities of tables of a kind, in their order."""
        return [name for name, quantity in self._known.items() if quantity.shown >= least]

    def is_component(self, name: str) -> bool:
        """True if it is a component of a vector whose size is in the catalogue, too."""
        found = self._known[name]
        whole = name.removesuffix(f'.{found.part}')
        return found.part in ('x', 'y') and f'{whole}.size' in self._known

    def below(self, name: str) -> list[str]:
        """The quantity of this name, else those whose names begin with it, as ``position``.

        Only those in tables count: ``position`` means that of coordinates.
        """
        if name in self._known:
            return [name]
        below = [known for known in self._known if known.startswith(f'{name}.')]
        shown = max((self._known[known].shown for known in below), default=Shown.ASKED)
        return [known for known in below if self._known[known].shown == shown]

    def choose(self, names: str | Iterable[str | Sequence[str]]) -> list[str]:
        """Names of the requested quantities; ``position`` means all that begin so."""
        found: dict[str, None] = {}
        for name in flat(names):
            found |= dict.fromkeys(self.below(name) or [self.find(name).name])
        return [*found]

    def find(self, name: str) -> Quantity:
        """The quantity of a name; of a vector without ``.size``, of a state without ``state.``."""
        known = self._known
        found = known.get(name) or known.get(f'{name}.size') or known.get(f'state.{name}')
        if found is None:
            raise self.unknown(name)
        return found

    def unknown(self, name: str) -> InputError:
        """Error of an unknown name of a quantity."""
        machine = self._machine
        if name.startswith('motor.') and 'motor.torque' not in self._known:
            return InputError(
                f"{machine.name}: '{name}': the drive is not a motor; drive_torque and "
                f'velocity.{machine.plan.main} are those of any drive'
            )
        if (sensor := name.removeprefix('sensor.')) in machine.scene.sensors:
            return InputError(
                f"{machine.name}: '{name}' is a sensor: in measures its samples are "
                f"'sensors.{sensor}', in Python those of to_frame('{sensor}')"
            )
        kinds = dict.fromkeys(q.kind for q in self._known.values())
        kind, _, joint = name.partition('.')
        forces = 'reaction', 'tooth_force', 'bearing_force'
        if kind in forces and joint.partition('.')[0] in machine.physics.undetermined:
            return InputError(f"{machine.name}: '{name}': {machine.nominal.undetermined_text}")
        if several := self.below(name):
            return InputError(
                f"{machine.name}: '{name}' stands for several quantities, one is needed: "
                f'{", ".join(several[:6])}{", ..." * (len(several) > 6)}'
            )
        bare = (known.removesuffix('.size') for known in self._known)
        said = nearest(name, [*self._known, *bare, *kinds])
        said = said or nearest(name, (), deeper=self._like(name))
        why = '' if machine.physics.has_forces else f'; of forces: {no_forces(machine)}'
        return InputError(
            f"{machine.name}: there is no quantity '{name}'{said}; quantities "
            f'begin with {", ".join(kinds)}{why}'
        )

    def _like(self, name: str) -> list[str]:
        """Quantities with the last word of a name, as of a coordinate or its rate in formulas."""
        word = name.rpartition('.')[2]
        link = word.removesuffix('_rate')
        begin = 'velocity.' if link != word else ''
        ending = (f'.{link}', f'_{link}') if link not in ('x', 'y', 'size') else ()
        return [x for x in self._known if x.startswith(begin) and x.endswith(ending)][:3]

    def table(self, names: Iterable[str], view: View) -> Table:
        """Quantities (N,) by name in a view of N instants, with their units."""
        columns = self.columns(names, view)
        return Table(columns, {name: self._known[name].unit for name in columns})

    def columns(self, names: Iterable[str], view: View) -> dict[str, Array]:
        """Quantities (N,) by name in a view of N instants."""
        return evaluated({name: self._known[name] for name in names}, view)


def catalogue(machine: Machine) -> Catalogue:
    """The catalogue of a machine, made once and kept with it."""
    found: Catalogue | None = vars(machine).get('_catalogue')
    if found is None:
        found = vars(machine)['_catalogue'] = Catalogue(machine)
    return found
