"""How pictures look, and where they go."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import output
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = ('.png', '.svg', '.pdf')

_DASHES = ('-', '--', '-.', ':', (0, (5, 1)), (0, (1, 1)), (0, (3, 1, 1, 1, 1, 1)))

_LETTERS = 110  # in a line of a legend

_STYLE: dict[Any, Any] = {
    'font.size': 9.0,
    'axes.linewidth': 0.7,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'grid.color': '0.9',
    'grid.linewidth': 0.6,
    'svg.hashsalt': 'mechanism_sim',  # the same picture is the same file
}


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib as all pictures want it; imported here, for it takes half a second."""
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context(_STYLE):
        yield


def titled(title: str, width: float = 7.0, height: float = 3.4) -> Figure:
    """An empty figure [in] under a title."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes half a second

    figure = Figure(figsize=(width, height), layout='constrained')
    figure.suptitle(title, fontsize=10.0)
    return figure


def over_turn(axes: Any, drive: str) -> None:
    """Lay the angle of a drive over a turn under axes."""
    from matplotlib.ticker import MultipleLocator  # noqa: PLC0415

    axes.set_xlim(0.0, 360.0)
    axes.xaxis.set_major_locator(MultipleLocator(45.0))
    axes.set_xlabel(f'angle of the {drive} [deg]')


def few_ticks(axes: Any) -> None:
    """No more than four circles on polar axes."""
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    axes.tick_params(labelsize=6.5, pad=0.0)
    axes.yaxis.set_major_locator(MaxNLocator(4))


def strokes(
    names: Iterable[str], numbers: Mapping[str, int] | None = None
) -> Iterator[dict[str, Any]]:
    """How lines are drawn: in the colour of what they are of, dashed to tell apart those of one.

    Parameters
    ----------
    names : of the lines, ``velocity.crank``, ``reaction.crank_coupler.x``
    numbers : of links and joints, whose colours their lines have; the others have the next ones
    """
    known, used, others = numbers or {}, Counter[str](), count()
    for name in names:
        number = next((known[part] for part in name.split('.') if part in known), None)
        shade = colour(next(others) if number is None else number)
        yield {'color': shade, 'ls': _DASHES[used[shade] % len(_DASHES)], 'lw': 1.2}
        used[shade] += 1


def legend(axes: Any, **more: Any) -> None:
    """A legend above axes, where there are no curves, of as many columns as there is room for."""
    longest = max(len(text) for text in axes.get_legend_handles_labels()[1])
    axes.legend(
        loc='lower left', bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, frameon=False,
        fontsize=7.5, ncols=max(1, _LETTERS // (longest + 8)), handlelength=2.6, **more,
    )  # fmt: skip


def check_picture(option: str, file: str, folder_too: bool = False) -> Path:
    """A path that a picture can be written to, checked before anything is computed.

    Parameters
    ----------
    option : of the command line, for the message
    folder_too : whether a folder will do; it is made when it is needed

    Raises
    ------
    InputError
    """
    path = Path(file)
    folder = folder_too and (path.is_dir() or not path.suffix)
    if not folder and path.suffix not in SUFFIXES:
        raise InputError(
            f'{option} {file}: the ending must be .png, .svg or .pdf'
            + (', or none for a folder' if folder_too else '')
        )
    if not path.resolve().parent.is_dir():
        raise InputError(f"{option} {file}: there is no directory '{path.parent}'")
    return path


def save(figure: Any, file: Path, cropped: bool = False) -> None:
    """Write one picture, on request cropped to what is on it.

    Raises
    ------
    InputError
        If it cannot be written there.
    """
    metadata = {'Date': None} if file.suffix == '.svg' else None
    # In memory first: Matplotlib's writer of PDF cannot give up halfway.
    picture = BytesIO()
    figure.savefig(
        picture, format=file.suffix[1:], dpi=200, metadata=metadata,
        bbox_inches='tight' if cropped else None,
    )  # fmt: skip
    output.write_bytes(file, picture.getvalue())


def save_all(figures: Mapping[str, Any], path: Path) -> list[Path]:
    """Write several pictures by name: pages of a PDF, else files ``STEM_NAME`` or in a folder.

    Raises
    ------
    InputError
        If they cannot be written there.
    """
    if path.suffix == '.pdf' and not path.is_dir():
        from matplotlib.backends.backend_pdf import PdfPages  # noqa: PLC0415

        book = BytesIO()
        with PdfPages(book, metadata={'CreationDate': None}) as pages:
            for figure in figures.values():
                pages.savefig(figure)
        output.write_bytes(path, book.getvalue())
        return [path]
    if path.is_dir() or not path.suffix:
        output.make_folder(path)
        files = [path / f'{name}.png' for name in figures]
    else:
        files = [path.with_name(f'{path.stem}_{name}{path.suffix}') for name in figures]
    for figure, file in zip(figures.values(), files, strict=True):
        save(figure, file)
    return files
