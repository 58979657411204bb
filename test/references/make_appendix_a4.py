"""The printed tables of the textbook's appendix A.4.1 and A.4.2, and what they should be.

Source: O. Vinogradov, Fundamentals of Kinematics and Dynamics of Machines and Mechanisms (CRC,
2000). `printed` holds the strings as they stand in Out[16], Out[17] (slider-crank) and Out[33],
Out[34] (four-bar). `computed` comes from intersecting circles with a line or a circle, which
is not the book's way; a printed value which is not its rounding to six digits is listed.

`python make_appendix_a4.py` writes `appendix_a4.json` beside this file.
"""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import mpmath as mp

mp.mp.dps = 40

R1 = """
5. 4.9391 4.76559 4.50512 4.19431 3.87298 3.57627 3.32955 3.14756 3.03699 3. 3.03699
3.14756 3.32955 3.57627 3.87298 4.19431 4.50512 4.76559 4.9391 5.
"""
SLIDER_TH3 = """
2π 6.20585 6.1357 6.07953 6.04312 6.03051 6.04312 6.07953 6.1357 6.20585 2π 0.0773313
0.14748 0.203659 0.240063 0.25268 0.240063 0.203659 0.14748 0.0773313 2π
"""
FOUR_BAR_TH3 = """
-0.981765 -1.08404 -1.16711 -1.21687 -1.23086 -1.21423 -1.17486 -1.12048 -1.05771
-0.991906 -0.927295 -0.867239 -0.814469 -0.771389 -0.7404 -0.724273 -0.726486 -0.751283
-0.802791 -0.882029
"""
FOUR_BAR_TH4 = """
1.63751 1.5223 1.40319 1.30099 1.22592 1.17978 1.16037 1.16445 1.18881 1.23057 1.287
1.35524 1.43205 1.51354 1.59483 1.66974 1.73029 1.76658 1.76751 1.72431
"""


def slider_crank(th2):
    """Piston distance, and angle in (0, 2 pi] of the rod from crank pin to piston."""
    pin = mp.expj(th2)
    r1 = pin.real + mp.sqrt(16 - pin.imag**2)
    th3 = mp.arg((r1 - pin) / 4)
    return r1, th3 if th3 > mp.mpf('1e-30') else th3 + 2 * mp.pi


def four_bar(th2):
    """Angles of r3 and r4 in the loop r1 + r2 + r3 + r4 = 0: (r1, th1) = (4, pi), 1, 6, 5.

    The joint between coupler and rocker is where two circles meet, below the frame line: the
    branch with a positive C in the book's In[10].
    """
    a, o4 = mp.expj(th2), mp.mpc(4)
    d = o4 - a
    along = (abs(d) ** 2 + 36 - 25) / (2 * abs(d))
    b = a + d / abs(d) * mp.mpc(along, -mp.sqrt(36 - along**2))
    return mp.arg(b - a), mp.arg(o4 - b)


def compare(printed, computed):
    """Indices of the printed values which are not the computed ones to six digits."""
    wrong = []
    for i, (text, x) in enumerate(zip(printed, computed, strict=True)):
        value = 2 * mp.pi if text == '2π' else mp.mpf(text)
        unit = mp.mpf(10) ** (int(mp.floor(mp.log10(abs(x)))) - 5)
        if abs(value - x) > unit / 2:
            wrong.append({'index': i, 'printed': text, 'computed': mp.nstr(x, 10)})
    return wrong


def table(printed, computed):
    printed = printed.split()
    return {
        'printed': printed,
        'computed': [mp.nstr(x, 20) for x in computed],
        'disagreements': compare(printed, computed),
    }


def main():
    angles = [mp.pi * i / 10 for i in range(21)]
    r1, slider = zip(*map(slider_crank, angles), strict=True)
    th3, th4 = zip(*map(four_bar, angles[:20]), strict=True)
    data = {
        'provenance': {
            'source': 'O. Vinogradov, Fundamentals of Kinematics and Dynamics of Machines and '
            'Mechanisms, CRC Press 2000, appendix A.4.1 and A.4.2',
            'script': Path(__file__).name,
            'date': str(date.today()),
        },
        'units': 'radians; crank angle i pi/10',
        'slider_crank': {
            'lengths': {'r2': '1', 'r3': '4'},
            'convention': 'th3 of the rod from the crank pin to the piston, in (0, 2 pi]',
            'r1': table(R1, r1),
            'th3': table(SLIDER_TH3, slider),
        },
        'four_bar': {
            'lengths': {'r1': '4', 'r2': '1', 'r3': '6', 'r4': '5'},
            'convention': 'vectors r1 + r2 + r3 + r4 = 0 with th1 = pi, so that th4 points from '
            'the coupler to the frame: the angle of the rocker as a link from its frame joint is '
            'th4 + pi; crossed branch (coupler-rocker joint below the frame line)',
            'th3': table(FOUR_BAR_TH3, th3),
            'th4': table(FOUR_BAR_TH4, th4),
        },
    }
    path = Path(__file__).with_name('appendix_a4.json')
    path.write_text(json.dumps(data, indent=1, ensure_ascii=False) + '\n')
    for name in ('slider_crank', 'four_bar'):
        for key, t in data[name].items():
            if isinstance(t, dict) and 'printed' in t:
                print(name, key, len(t['printed']), 'values, disagreements', t['disagreements'])


if __name__ == '__main__':
    main()
