"""The name of a force element of a scene, by which its parameters are known."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SceneElement:
    """A force element of a scene, ``springs.NAME`` or ``loads.NAME``."""

    name: str

    @property
    def key(self) -> str:
        """With which the keys of its parameters begin: no joint has such a name."""
        return self.name.replace('.', ':', 1)
