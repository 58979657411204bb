"""A scene by name, path or text as a machine that runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from mechanism_sim.scene.build import build
from mechanism_sim.scene.doubts import length_questions
from mechanism_sim.scene.files import check_scene, find_scene, overridden, read_yaml
from mechanism_sim.scene.machine import Machine


def load_scene(name: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> Machine:
    """A scene of the package by name, or your own by path, ready to run.

    Parameters
    ----------
    name : such as ``'four_bar_clearance'`` or ``'my/machine.yaml'``
    overrides : values by dotted path, such as ``{'drive.speed': '300 rpm'}``
    """
    path = find_scene(name)
    content = overridden(path.name, read_yaml(path, 'scene'), overrides)
    return build(path.stem, check_scene(path.name, content), tuple(length_questions(content)))
