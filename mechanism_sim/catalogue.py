"""Contents of the package: where its scenes are, their names, and its version.

Apart from the rooms, because a shell that completes a name cannot wait for the mechanics.
"""

from __future__ import annotations

import sysconfig
from pathlib import Path

TABLE_FOLDERS = 'MECHANISM_SIM_TABLES'
"""Environment variable: folders, apart by `os.pathsep`, below which tables may lie."""
SCENE_TABLE = 'scenes.tsv'
"""Names, titles and levels of the scenes, as `docs/scene_table.py` writes them."""


def config_folder() -> Path:
    """Folder of the package's scenes: beside the sources, or installed by pip or colcon."""
    package = Path(__file__).parent
    shared = Path('share', 'mechanism_sim', 'config')
    for folder in [package.parent / 'config', *(root / shared for root in package.parents)]:
        if folder.is_dir():
            return folder
    return Path(sysconfig.get_path('data')) / shared


def installed_version() -> str:
    """The version of the package; empty for sources that nothing has installed."""
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    try:
        return version('mechanism_sim')
    except PackageNotFoundError:
        return ''


def scene_names() -> list[str]:
    """Names of the scenes that come with the package.

    >>> import mechanism_sim as ms
    >>> ms.scene_names()[:2]
    ['adjustable_stroke_drive', 'andrews_squeezer']
    """
    return sorted(path.stem for path in config_folder().glob('*.yaml'))


def scene_rows() -> list[dict[str, str]]:
    """Name, title and level of the scenes that come with the package; no machine is built."""
    lines = (config_folder() / SCENE_TABLE).read_text(encoding='utf-8').splitlines()
    return [dict(zip(('name', 'title', 'level'), x.split('\t'), strict=True)) for x in lines]


def sweep_names() -> list[str]:
    """Names of the sweeps that come with the package."""
    return sorted(path.stem for path in (config_folder() / 'sweeps').glob('*.yaml'))
