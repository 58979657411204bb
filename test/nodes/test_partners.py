"""Selection among simultaneous runs, by every order in which they see each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from mechanism_sim.errors import RunError
from mechanism_sim.nodes import partners


class Context:
    """Context of a node in which `Partners` remembers when it was joined."""


class Beginner:
    """A node that waits until it is sure to be the first, as far as `Partners` asks it."""

    def __init__(self) -> None:
        self.context, self.seen, self.mark = Context(), set(), ''
        self.partners = partners.Partners(self)
        self.partners.show_start()
        self.partners.expect()

    def declare(self, *_: object, **more: object) -> None: ...

    declare_list = declare

    def names(self, parameter: str) -> list[str]:
        return ['crank_drive'] if parameter == 'partners' else []

    def get_name(self) -> str:
        return 'monitor'

    def value(self, _: str) -> float:
        return 20.0

    def create_publisher(self, kind: object, topic: str, depth: int) -> SimpleNamespace:
        self.mark = f'/{topic}'
        return SimpleNamespace(topic_name=self.mark)

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(node.mark, []) for node in {self, *self.seen}]

    def get_publishers_info_by_topic(self, _: str) -> list[SimpleNamespace]:
        return [SimpleNamespace(node_name='monitor', endpoint_gid=[]) for _ in {self, *self.seen}]

    get_subscriptions_info_by_topic = get_publishers_info_by_topic


def courses() -> Iterator[tuple[str, ...]]:
    """Orders in which each of two sees the other and looks."""
    yield from set(itertools.permutations(('0 sees', '1 sees', '0 looks', '1 looks')))


@pytest.mark.parametrize('course', sorted(courses()), ids=' '.join)
def test_one_of_two_goes_on(monkeypatch, course):
    now = 0.0
    clock = SimpleNamespace(monotonic=lambda: now, time_ns=itertools.count(1).__next__)
    monkeypatch.setattr(partners, 'time', clock)
    nodes = [Beginner(), Beginner()]
    left, first = set(), set()
    # then both look once more, when each would have seen the other, and once the other has left
    for step in (*course, 'later', '0 sees', '1 sees', *('0 looks', '1 looks') * 2):
        number, _, act = step.partition(' ')
        if step == 'later':
            now = 1.0
            continue
        node, other = nodes[int(number)], nodes[1 - int(number)]
        if act == 'sees':
            node.seen = {other} - left
        elif node not in left | first:
            try:
                if node.partners.came_first():
                    first.add(node)
            except RunError:
                left.add(node)
                other.seen = set()
    assert (first, left) == ({nodes[0]}, {nodes[1]})


class Waiting(Beginner):
    """A node with a partner that others start and end."""

    done, spoken = False, ()

    def present(self, *ids: int) -> None:
        """Let partners with these ids be in the graph."""
        name = 'crank_drive'
        self._infos = [SimpleNamespace(node_name=name, endpoint_gid=[n]) for n in ids]

    def get_publishers_info_by_topic(self, _: str) -> list[SimpleNamespace]:
        return self._infos

    get_subscriptions_info_by_topic = get_publishers_info_by_topic


def test_a_partner_that_is_started_anew_has_left(monkeypatch):
    """It knows nothing of the run: all would wait for each other for ever."""
    now = 0.0
    clock = SimpleNamespace(monotonic=lambda: now, time_ns=lambda: 1)
    monkeypatch.setattr(partners, 'time', clock)
    node = Waiting()
    for ids in ((1,), (2,)):  # before the run that does not matter
        node.present(*ids)
        assert not node.partners.gathered()
    now = 1.0
    assert node.partners.gathered()
    for ids in ((2,), (3, 2), (2, 3), (3,), (2,), (3,)):
        node.present(*ids)
        now += 2.0
        node.partners.check_presence()
    now += 4.0
    said = "^monitor: 'crank_drive' left .* finished, and another of its name has begun; what"
    with pytest.raises(RunError, match=said):
        node.partners.check_presence()
    node.present()
    with pytest.raises(RunError, match='finished; what was received'):
        node.partners.check_presence()
