"""A first model of the data set of `config/sweeps/loose_machines.yaml`, tested in three ways.

    mechanism-sim sweep loose_machines
    python examples/loose_machines.py loose_machines.windows

Energies in octaves of a window, its peak and its kurtosis go to a forest that tells the state of
the bearing. Machines, motions or speeds that it has not seen say what it is worth; windows at
random do not, for those of one motion are alike.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from sklearn.ensemble import RandomForestClassifier
from sklearn.model_selection import KFold, StratifiedGroupKFold, cross_val_score

LABELS = ['run', 'title', 'description', 'drive.speed', 'crank_speed']


def features(signals: np.ndarray) -> np.ndarray:
    """Figures (N, 14) of windows (N, 1024)."""
    x = signals - signals.mean(axis=1, keepdims=True)
    rms = np.sqrt((x**2).mean(axis=1))
    power = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]))) ** 2
    octaves = [power[:, 2**k : 2 ** (k + 1)].sum(axis=1) for k in range(9)]
    shape = np.abs(x).max(axis=1) / rms, (x**4).mean(axis=1) / rms**4
    steps = np.abs(np.diff(x, axis=1))
    return np.column_stack(
        [
            np.log(rms),
            *shape,
            *np.log(octaves),
            np.log(steps.max(axis=1)),
            np.log(steps.mean(axis=1)),
        ]
    )


def read(folder: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Figures and labels of all windows of a folder, a file at a time."""
    figures, labels = [], {name: [] for name in LABELS}
    for file in sorted(folder.glob('run_*.parquet')):
        table = pq.read_table(file, columns=[*LABELS, 'signal'])
        signal = table['signal'].combine_chunks().flatten().to_numpy()
        figures.append(features(signal.reshape(table.num_rows, -1).astype(float)))
        for name in LABELS:
            labels[name].append(table[name].to_numpy(zero_copy_only=False))
    return np.concatenate(figures), {k: np.concatenate(v) for k, v in labels.items()}


def scores(figures: np.ndarray, labels: dict[str, np.ndarray]) -> dict[str, float]:
    """Share of the windows that are told right, by what is left out of learning."""
    known = np.column_stack([figures, labels['crank_speed']])
    forest = RandomForestClassifier(100, min_samples_leaf=3, random_state=0)
    keys = {'windows': '', 'motions': 'run', 'speeds': 'drive.speed', 'machines': 'title'}
    found = {}
    for name, key in keys.items():
        groups, folds = None, KFold(5, shuffle=True, random_state=0)
        if key:
            groups = labels[key]
            count = min(5, len(np.unique(groups)))
            if count < 2:  # with one of them none can be left out
                continue
            folds = StratifiedGroupKFold(count)
        shares = cross_val_score(forest, known, labels['description'], cv=folds, groups=groups)
        found[name] = float(shares.mean())
    return found


if __name__ == '__main__':
    figures, labels = read(Path(sys.argv[1] if len(sys.argv) > 1 else 'loose_machines.windows'))
    print(f'{len(figures)} windows, {len(np.unique(labels["title"]))} machines')
    for name, score in scores(figures, labels).items():
        print(f'{name} not seen: {score:.2f}')
