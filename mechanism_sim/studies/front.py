"""Fronts of Pareto: designs of which none is better in all that is to be small.

Evolution after Deb et al., IEEE Trans. on Evolutionary Computation 6 (2002) 182-197 (NSGA-II): of
parents and children the best live on, by the number of layers of better designs above them,
and within a layer by their distance from neighbours. Those that keep constraints come first.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array

_CROSSING, _MUTATION = 15.0, 20.0  # indices of the distributions of children: near to parents

Judge = Callable[[Array], tuple[Array, Array, Array]]
"""Measures (N, M), costs (N, K) and violations of constraints (N,) at places (N, n)."""


def undominated(costs: Array, excess: Array) -> list[int]:
    """Designs that hold all constraints and that no other is better than, by the first cost."""
    held = np.flatnonzero((excess <= 0.0) & (costs < 1e5).all(axis=1))
    kept = held[_layers(costs[held]) == 0]
    order = np.lexsort(costs[kept].T[::-1])
    _, first = np.unique(costs[kept][order], axis=0, return_index=True)
    return [int(kept[order][k]) for k in sorted(first)]


def _layers(costs: Array) -> Array:
    """Rank of each design (N,) by costs (N, K): the number of layers that dominate it."""
    one, other = costs[:, None], costs[None]
    below: Array = np.all(one <= other, axis=2) & np.any(one < other, axis=2)
    above = below.sum(axis=0)
    layers, layer = np.full(len(costs), -1), 0
    while (now := np.flatnonzero((above == 0) & (layers < 0))).size:
        layers[now] = layer
        above = above - below[now].sum(axis=0)
        layer += 1
    return layers


def _distances(costs: Array, layers: Array) -> Array:
    """Distance (N,) between the neighbours of each design in its layer; without limit at ends."""
    found = np.zeros(len(costs))
    for layer in np.unique(layers):
        own = np.flatnonzero(layers == layer)
        for cost in costs[own].T:
            order = np.argsort(cost)
            span = cost[order[-1]] - cost[order[0]]
            found[own[order[[0, -1]]]] = np.inf
            if span > 0.0:
                found[own[order[1:-1]]] += (cost[order[2:]] - cost[order[:-2]]) / span
    return found


def _ranked(costs: Array, excess: Array) -> NDArray[np.intp]:
    """Order (N,) from the best to the worst."""
    layers = _layers(costs)
    return np.lexsort((-_distances(costs, layers), layers, excess))


def _children(parents: Array, rng: np.random.Generator) -> Array:
    """Children (N, n) of parents from the best to the worst: crossed in pairs, and mutated."""
    count, n = parents.shape
    chosen = np.sort(rng.integers(count, size=(2, count, 2)), axis=2)[..., 0]  # better of two
    one, other = parents[chosen[0]], parents[chosen[1]]
    u = rng.random((count, n))
    spread = np.where(u < 0.5, 2.0 * u, 0.5 / (1.0 - u)) ** (1.0 / (_CROSSING + 1.0))
    spread = np.where(rng.random((count, n)) < 0.5, spread, 1.0)
    child = 0.5 * ((1.0 + spread) * one + (1.0 - spread) * other)
    v = rng.random((count, n))
    shift = np.where(
        v < 0.5, (2.0 * v) ** (1.0 / (_MUTATION + 1.0)) - 1.0,
        1.0 - (2.0 - 2.0 * v) ** (1.0 / (_MUTATION + 1.0)),
    )  # fmt: skip
    child += np.where(rng.random((count, n)) < 1.0 / n, shift, 0.0)
    return np.asarray(np.clip(child, 0.0, 1.0))


def evolve(judge: Judge, places: Array, generations: int) -> tuple[Array, Array]:
    """Places and measures of all designs of some generations, the first of which is given."""
    rng, size = np.random.default_rng(1), len(places)
    figures, costs, excess = judge(places)
    every = [(places, figures)]
    for _ in range(generations):
        order = _ranked(costs, excess)[:size]
        places, costs, excess = places[order], costs[order], excess[order]
        children = _children(places, rng)
        more = judge(children)
        every.append((children, more[0]))
        places = np.vstack([places, children])
        costs, excess = np.vstack([costs, more[1]]), np.concatenate([excess, more[2]])
    return np.vstack([x for x, _ in every]), np.vstack([f for _, f in every])
