"""Reference for the flexible slider-crank of the IVP test set: DOP853 on its own matrices.

`benchmarks.flexible_slider_crank` has them, written by hand; two tolerances agree in what
is kept. `python make_elastic_slider_crank.py` writes `elastic_slider_crank.json` to
benchmarks/references.
"""

from __future__ import annotations

import json
import platform
from datetime import date

import numpy as np
import scipy
from make_nominal import REFERENCES
from scipy.integrate import solve_ivp

from benchmarks.flexible_slider_crank import END, closed_start, rates


def main():
    """Integrate twice and write."""
    ends = [
        solve_ivp(rates(), (0.0, END), closed_start(), 'DOP853', rtol=rtol, atol=atol).y[2:4, -1]
        for rtol, atol in ((1e-12, 1e-15), (1e-13, 1e-16))
    ]
    slider, bend = (f'{x:.17g}' for x in ends[1])
    data = {
        'provenance': {
            'method': 'DOP853 at rtol 1e-13, index 1, by the matrices of the test set',
            'difference_to_rtol_1e-12': f'{np.abs(ends[1] - ends[0]).max():.1g}',
            'script': 'make_elastic_slider_crank.py',
            'date': date.today().isoformat(),
            'python': platform.python_version(),
            'scipy': scipy.__version__,
        },
        'units': 'SI',
        'duration': f'{END}',
        'slider': slider,
        'bend1': bend,
    }
    path = REFERENCES / 'elastic_slider_crank.json'
    path.write_text(json.dumps(data, indent=1) + '\n')
    print(data)


if __name__ == '__main__':
    main()
