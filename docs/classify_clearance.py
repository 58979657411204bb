"""Classification of bearing clearances: windows of a sweep, features, a random forest.

``python docs/classify_clearance.py FOLDER`` reads the windows that ``mechanism-sim sweep
bearing_wear`` wrote, prints the tables of analysis.md and, with ``--plot``, draws its
picture. Needs scikit-learn: ``pip install 'mechanism_sim[examples]'``.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import confusion_matrix
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, StratifiedKFold

from mechanism_sim.sensing.indicators import indicators

CLEARANCE = 'joints.coupler_rocker.clearance.radial'
RESTITUTION = 'joints.coupler_rocker.clearance.restitution'
NOISE = 'sensors.rocker_accelerometer.noise.rms'
SPEED = 'drive.speed'
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Data:
    """N windows.

    Attributes
    ----------
    figures : (N, features) features of each window
    label : (N,) index of the clearance
    clearances : (classes,) [m]
    speed, noise : (N,) [rad/s] and [m/s^2]
    motion : (N,) number of the motion, independent of the noise
    run : (N,) number of the run, of one motion and noise
    """

    figures: Array
    label: NDArray[np.intp]
    clearances: Array
    speed: Array
    noise: Array
    motion: NDArray[np.intp]
    run: NDArray[np.intp]


def read(folder: str, every: int = 1) -> Data:
    """The figures of the windows of a folder, of one in `every`; no window is kept."""
    dataset = ds.dataset(folder)
    figures, columns = [], {name: [] for name in (CLEARANCE, RESTITUTION, NOISE, SPEED, 'run')}
    for batch in dataset.to_batches(batch_size=4096):
        chosen = batch.take(np.flatnonzero(batch['window'].to_numpy() % every == 0))
        if not chosen.num_rows:
            continue
        signal = chosen['signal'].flatten().to_numpy().reshape(chosen.num_rows, -1)
        figures.append(describe(signal.astype(float)))
        for name, parts in columns.items():
            parts.append(chosen[name].to_numpy())
    known = {name: np.concatenate(parts) for name, parts in columns.items()}
    clearances, label = np.unique(known[CLEARANCE], return_inverse=True)
    machines = np.column_stack([known[name] for name in (CLEARANCE, RESTITUTION, SPEED)])
    motion = np.unique(machines, axis=0, return_inverse=True)[1].ravel()
    return Data(
        np.column_stack([np.concatenate(figures), known[SPEED]]),  # the operator knows the speed
        label,
        clearances,
        known[SPEED],
        known[NOISE],
        motion,
        known['run'],
    )


def describe(signal: Array) -> Array:
    """Figures (N, features) of windows: indicators, and energies of thirds of octaves."""
    x = signal - signal.mean(axis=1, keepdims=True)
    found = [indicators(window) for window in x]
    levels = np.log([(i.rms, i.peak) for i in found])
    shapes = [(i.crest, i.kurtosis, i.skewness, i.shape, i.impulse, i.clearance) for i in found]
    power = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]))) ** 2
    thirds = np.unique(np.round(2.0 ** np.arange(0.0, np.log2(power.shape[1]), 1 / 3)).astype(int))
    return np.column_stack([levels, shapes, np.log(np.add.reduceat(power, thirds, axis=1))])


def predict(data: Data, folds) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Cross-validated predictions of a random forest for every window.

    Returns
    -------
    Indices of the windows, and their predicted classes.
    """
    asked, said = [], []
    for train, test in folds:
        forest = RandomForestClassifier(100, min_samples_leaf=5, random_state=0)
        forest.fit(data.figures[train], data.label[train])
        asked.append(test)
        said.append(forest.predict(data.figures[test]))
    return np.concatenate(asked), np.concatenate(said)


def main() -> None:
    """Print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder')
    parser.add_argument('--every', type=int, default=1, help='take one window in so many')
    parser.add_argument('--plot', metavar='FILE')
    options = parser.parse_args()
    data = read(options.folder, options.every)
    X, y = data.figures, data.label
    print(f'{len(y)} windows of {len(np.unique(data.run))} runs, {len(np.unique(data.motion))} '
          f'motions; chance {1 / len(data.clearances):.2f}')  # fmt: skip
    ways = {
        'windows drawn at random': StratifiedKFold(5, shuffle=True, random_state=0).split(X, y),
        'motions not seen before': GroupKFold(5, shuffle=True, random_state=0).split(
            X, y, data.motion
        ),
        'a speed not seen before': LeaveOneGroupOut().split(X, y, data.speed),
    }
    matrices = {}
    for way, folds in ways.items():
        asked, said = predict(data, folds)
        right = said == y[asked]
        near = np.abs(said - y[asked]) <= 1
        matrices[way] = confusion_matrix(y[asked], said, normalize='true')
        print(f'{way}: {right.mean():.3f} right, {near.mean():.3f} right or next to it; '
              f'by vote of a run {vote(data, asked, said):.3f}')  # fmt: skip
        for what, values, scale in (('noise', data.noise, 1.0), ('rpm', data.speed, 30 / np.pi)):
            parts = [
                f'{scale * v:.0f}: {right[values[asked] == v].mean():.3f}'
                for v in np.unique(values)
            ]
            print(f'  by {what}: {", ".join(parts)}')
        print(np.array2string(matrices[way], precision=2, suppress_small=True))
    if options.plot:
        draw(Path(options.plot), matrices, data.clearances)


def vote(data: Data, asked: NDArray[np.intp], said: NDArray[np.intp]) -> float:
    """Share of the runs whose windows are right by majority."""
    votes = np.zeros((data.run.max() + 1, len(data.clearances)))
    np.add.at(votes, (data.run[asked], said), 1)
    runs, first = np.unique(data.run, return_index=True)
    return float((votes[runs].argmax(axis=1) == data.label[first]).mean())


def draw(file: Path, matrices: dict[str, Array], clearances: Array) -> None:
    """Confusion matrices side by side, readable in grey."""
    import matplotlib as mpl  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    with mpl.rc_context({'font.size': 9.0, 'svg.hashsalt': 'mechanism_sim'}):
        figure = Figure(figsize=(9.5, 3.4), layout='constrained')
        said = [f'{1e3 * c:g}' for c in clearances]
        for axes, (way, matrix) in zip(figure.subplots(1, 3), matrices.items(), strict=True):
            axes.imshow(matrix, cmap='Greys', vmin=0.0, vmax=1.0)
            for (i, j), part in np.ndenumerate(matrix):
                shade = 'white' if part > 0.5 else 'black'
                axes.text(j, i, f'{part:.2f}', ha='center', va='center', color=shade)
            axes.set_xticks(range(len(said)), said)
            axes.set_yticks(range(len(said)), said)
            axes.set_title(way, fontsize=9.0)
            axes.set_xlabel('said [mm]')
        figure.axes[0].set_ylabel('radial clearance [mm]')
        figure.savefig(file, metadata={'Date': None} if file.suffix == '.svg' else None)


if __name__ == '__main__':
    main()
