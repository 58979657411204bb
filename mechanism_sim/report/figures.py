"""Style of pictures, and their files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import output
from mechanism_sim.errors import InputError
from mechanism_sim.report.charts.chart import Chart

if TYPE_CHECKING:
    from mechanism_sim.report.picture import Picture

SUFFIXES = ('.png', '.svg', '.pdf')

_STYLE: dict[Any, Any] = {
    'font.size': 9.0,
    'axes.linewidth': 0.7,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.formatter.useoffset': False,  # a number at a tick is the whole number
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


def paint(chart: Chart) -> Picture:
    """A picture of a chart."""
    with style():
        from mechanism_sim.report import painting  # noqa: PLC0415 - takes half a second

        return painting.paint(chart)


def check_picture(
    option: str, file: str, folder_too: bool = False, numbers: Sequence[str] = ()
) -> Path:
    """A path that a picture can be written to, checked before anything is computed.

    Parameters
    ----------
    option : option of the command line, for the message
    folder_too : allow a folder, which is made when needed
    numbers : endings of files of numbers, which the option takes as well
    """
    path = Path(file)
    if folder_too and (path.is_dir() or not path.suffix):
        return output.check_path(option, file, path.suffix)
    more = ', or none for a folder' if folder_too else ''
    more = f' for a picture, {", ".join(numbers)} for numbers' if numbers else more
    if more and path.suffix not in SUFFIXES:
        raise InputError(f'{option} {file}: the ending must be .png, .svg or .pdf{more}')
    return output.check_path(option, file, *SUFFIXES)


def draw(chart: Chart, file: Path) -> None:
    """Write the picture of a chart."""
    save(paint(chart), file)


def save(figure: Any, file: Path, cropped: bool = False) -> None:
    """Write one picture, on request cropped to what is on it."""
    metadata = {'Date': None} if file.suffix == '.svg' else None
    # In memory first: Matplotlib's writer of PDF cannot give up halfway.
    picture = BytesIO()
    with style():
        figure.savefig(
            picture, format=file.suffix[1:], dpi=200, metadata=metadata,
            bbox_inches='tight' if cropped else None,
        )  # fmt: skip
    output.write_bytes(file, picture.getvalue())


def save_all(charts: Iterable[Chart], path: Path) -> list[Path]:
    """Write charts by their keys: pages of a PDF, else files ``STEM_KEY`` or in a folder."""
    figures = {chart.key: paint(chart) for chart in charts}
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
