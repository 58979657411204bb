"""A scene of one's own, begun from one that exists."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from mechanism_sim import output
from mechanism_sim.errors import InputError
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import as_given, check_scene, find_scene, overridden, read_yaml
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.scene_writer import commented
from mechanism_sim.scene.schema import Scene

TEMPLATES = {'four_bar': 'four_bar_clearance', 'linkage': 'slider_crank_engine'}
"""The scenes that show the two forms of scenes, by the names of the forms."""

SCHEMA = 'mechanism_sim.schema.json'
"""Schema that editors read, if it lies beside the scene."""


def json_schema() -> dict[str, Any]:
    """JSON schema of scenes, which editors read."""
    either = Annotated[FourBarScene | Scene, Field(discriminator='mechanism')]
    schema: dict[str, Any] = TypeAdapter[Any](either).json_schema()
    return {'$schema': 'https://json-schema.org/draft/2020-12/schema', **schema}


def new_scene(name: str, source: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> Path:
    """Write a commented scene, and say where.

    Parameters
    ----------
    name : of the scene; its file is ``NAME.yaml``, in a folder that exists
    source : a scene of the package or a path
    overrides : values by dotted path, or texts ``path=value``
    """
    file = Path(name if name.endswith(('.yaml', '.yml')) else f'{name}.yaml')
    if file.stem.startswith('.') or not Path(name).name or name.endswith('/'):
        raise InputError(f"'{name}' is not a valid name for a scene: write for example my_machine")
    with output.errors_as_sentences(file):
        there = file.exists()
    if there:
        raise InputError(f"'{file}' exists already; choose another name")
    path = find_scene(source)
    source_data = read_yaml(path, 'scene')
    data = overridden(path.name, source_data, overrides, path.parent)
    if data.get('title') == source_data.get('title'):
        data = {**data, 'title': file.stem.replace('_', ' ').strip().capitalize() or file.stem}
    build(path.stem, check_scene(path.name, data))
    text = commented(data, as_given(path.name, data))
    if (file.parent / SCHEMA).is_file():
        text = f'# yaml-language-server: $schema={SCHEMA}\n{text}'
    output.write_text(file, text)
    return file
