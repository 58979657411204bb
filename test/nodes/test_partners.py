"""Who goes on of runs that begin at the same time, by every order in which they see each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from mechanism_sim.errors import RunError
from mechanism_sim.nodes import partners


class Context:
    """What `Partners` remembers when it was joined."""


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
        return [SimpleNamespace(node_name='monitor') for _ in {self, *self.seen}]

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
