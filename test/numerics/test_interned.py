"""Expressions that are kept: the same where they are equal, and never compared without end."""

import heyoka as hy

from mechanism_sim.numerics import symbolic

X, Y = hy.make_vars('x', 'y')


def deep(depth):
    """A tree of 4^depth nodes of few parts."""
    x = hy.sin(X) + Y
    for _ in range(depth):
        x = hy.cos(x) * x + hy.sin(x + 1.5)
    return x


def test_equal_terms_give_the_same_object():
    assert symbolic.mul(hy.sin(X), Y) is symbolic.mul(hy.sin(X), Y)
    assert symbolic.mul(X, Y) is not symbolic.mul(Y, X)
    assert symbolic.add(X, Y) == X + Y
    assert symbolic.add(X, None, 2.0) == X + 2.0
    one, two = (symbolic.substitute([X * Y, Y], {X: Y})[0] for _ in range(2))
    assert one is two
    assert one == Y * Y


def test_what_was_let_go_of_is_made_anew():
    symbolic.forget()
    first = symbolic.mul(X, Y)
    symbolic.forget()
    assert symbolic.mul(X, Y) is not first
    assert symbolic.mul(X, Y) == first


def test_large_trees_are_not_compared():
    """A worn bearing's forces are such: no run of one began."""
    for _ in range(2):
        assert symbolic.mul(deep(40), Y) is not None
