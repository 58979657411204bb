# ruff: noqa: E501 - tables of what goes wrong
"""Broken scenes: what people and programs do to a file, and what nobody should."""

from __future__ import annotations

import copy
import random
import re
from datetime import date
from pathlib import Path

import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
SCENES = sorted(CONFIG.glob('*.yaml'))
SWEEPS = sorted((CONFIG / 'sweeps').glob('*.yaml'))

NUMBERS = (
    0, 1, -1, 1e-300, -1e-300, 5e-324, 1e16, 1e100, -1e150, 1e300, 1.7976931348623157e308,
    10**400, -(10**400), float('inf'), float('-inf'), float('nan'), True, 1e-16, 2**63,
)  # fmt: skip
TEXTS = (
    '', ' ', '1e400', '1e400 mm', '-1e-400 m', '1e999999999 m', '1 m^99', '1 m**1e9', '1 mm mm mm',
    '5 ' + 'm ' * 500, '1 (((((((((m', '1 m/0', '1 kg m^2/s^2/rad', '1 degC', '1 dB', '1 %', '1 _',
    '1 µm', '１２ mm', '٣ mm', 'nan', 'inf m', '-inf', '0x10 m', '1_000 mm', '1,5 mm', '1 lambda',
    '1 planck_constant', '1 import', '1 m\x00', '1 m\nm', '+' * 3000 + '1', '(' * 500 + 'x' + ')' * 500,
    'sin(' * 90 + 't' + ')' * 90, '1/0', 'log(t)', 'sqrt(t-1)', 'sqrt(-1)', 'log(0)', '0/0', 't**t',
    't**1000000', '9**9**9**9', 'tan(t*1e300)', 'exp(exp(exp(t*1000)))', '1e400', 'x.y', 'lambda: 0',
    '[1]', '{}', 'f"{t}"', 't if t else t', "__import__('os')", 'sin', 'sin()', 'sin(t, t)', 'True',
    'pi', '1j', '"t"', 't' * 5000, '\ud800', '\x1b[31mred', '\u202e', 'a' * 200_000, 'ground', 'crank',
    'rough', 'spline', '~', '../../etc/passwd', '%s%n', '{0}', 'é' * 60, '\U0001f600', '.', '..', 'a.b',
)  # fmt: skip
KEYS = (
    'curv', 'x', '', ' ', 'ground', 'crank', '0', '1', '\ud800', 'a.b', 'k' * 500, '__class__', '<<',
    'model_config', 'begin', 'from', 'é', 'a b', '\x00', 'self',
)  # fmt: skip
RAW = (
    'a: &a [1,1,1,1,1,1,1,1,1]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b]\n'
    'd: &d [*c,*c,*c,*c,*c,*c,*c,*c]\ne: &e [*d,*d,*d,*d,*d,*d,*d,*d]\nf: [*e,*e,*e,*e,*e,*e]\n',
    'a: &a {k: 1}\nb: &b {<<: [*a, *a, *a]}\nc: {<<: [*b, *b]}\n', '&a [*a]', 'a: &a {b: *a}',
    'x: ' + '[' * 3000, 'x: ' + '{a: ' * 3000, '? [1, 2]\n: 3\n', '? {a: 1}\n: 3\n', '2001-01-01: 1\n',
    'x: 2001-01-01\n', 'x: 2001-13-45 25:61:61\n', 'x: 0b12\n', 'x: 1:99:99\n', 'x: 0o9\n', 'x: 09\n',
    'x: !!binary "%%%"\n', 'x: !!timestamp foo\n', 'x: !!int foo\n', 'x: !!float foo\n', 'x: !!set {a}\n',
    'x: !!omap [1]\n', 'x: !!pairs 5\n', 'x: !foo bar\n', 'x: !!python/object:os.system 1\n', '- ' * 3000,
    'x: "\\ud800"\n', 'x: "\\U00110000"\n', 'x: "\\Uffffffff"\n', 'x: "\\xZZ"\n', '%YAML 9.9\n---\nx: 1\n',
    '--- 1\n--- 2\n', '\ufeffx: 1\n', 'x: 1\n...\n%TAG ! !\n', '{<<: 5}', '{<<: [5]}', 'x: *nobody\n',
    '\t x: 1\n', 'x: |\n' + ' a\n' * 100_000, '# ' + 'c' * 400_000, 'x' * 2000 + ': 1\n', 'null', '[]', '5',
    'x: =\n', '<<: {title: 5}\n', 'x: 1' + '0' * 6000 + '\n', 'x: -.INF\n', 'x: 1.0e+999\n',
)  # fmt: skip


def places(data: object, path: tuple = ()) -> list[tuple]:
    """Paths of all values in lists and keys."""
    inside = (
        data.items()
        if isinstance(data, dict)
        else enumerate(data)
        if isinstance(data, list)
        else ()
    )
    return [path] * bool(path) + [p for key, value in inside for p in places(value, (*path, key))]


def nested(depth: int, kind: type) -> object:
    """Lists or keys in each other."""
    value: object = 1
    for _ in range(depth):
        value = [value] if kind is list else {'a': value}
    return value


def damage(dice: random.Random, data: dict) -> None:
    """Change one place of a scene."""
    path = dice.choice(places(data))
    holder: object = data
    for key in path[:-1]:
        holder = holder[key]
    key, old = path[-1], holder[path[-1]]
    what = dice.choice((0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 8, 9, 9, 10, 11, 11, 11))
    if what == 0:
        holder[key] = dice.choice(NUMBERS)
    elif what == 1:
        holder[key] = dice.choice(TEXTS)
    elif what == 2:
        del holder[key]
    elif what == 3 and isinstance(holder, dict):
        holder[dice.choice((*KEYS, *NUMBERS[:4], (1, 2), date(2001, 1, 1), None))] = old
    elif what == 4 and isinstance(holder, dict):
        holder[dice.choice(KEYS)] = holder.pop(key)
    elif what == 5:
        holder[key] = dice.choice(
            (None, [], {}, [old], {'a': old}, [old] * 50, date(2001, 1, 1), b'x', {1})
        )
    elif what == 6:
        holder[key] = nested(dice.choice((3, 30, 90)), dice.choice((list, dict)))
    elif what == 7:
        other = dice.choice(places(data))
        value: object = data
        for step in other:
            value = value[step]
        holder[key] = copy.deepcopy(value)
    elif what == 8 and isinstance(old, str) and old:
        text = list(old)
        text[dice.randrange(len(text))] = dice.choice('0123456789 +-*/().eEmktx^\'"\\%#é\x00')
        holder[key] = ''.join(text)
    elif what == 9 and isinstance(old, str) and old.split():
        factor = dice.choice(
            ('0', '-1', '1e-12', '1e-3', '0.5', '1.1', '2', '30', '1e12', '1e200', '1e-29')
        )
        holder[key] = ' '.join([factor, *old.split()[1:]])
    elif what == 10 and isinstance(holder, list):
        dice.shuffle(holder)
    else:
        holder[key] = dice.choice(
            (dice.uniform(-10, 10), dice.randrange(-5, 100), f'{dice.uniform(-5, 5):g} mm')
        )


def detune(dice: random.Random, data: dict) -> None:
    """Change one number of a scene, or one formula, to what might be meant."""
    found = []
    for path in places(data):
        value: object = data
        for key in path:
            value = value[key]
        if isinstance(value, int | float | str) and re.match('[-+.0-9]', str(value)):
            found.append((path, value))
        elif path[-1] in ('force', 'torque'):
            found += [(path, value)] * 5
    if not found:
        return
    path, old = dice.choice(found)
    holder: object = data
    for key in path[:-1]:
        holder = holder[key]
    if path[-1] in ('force', 'torque'):
        holder[path[-1]] = dice.choice((dice.choice(TEXTS), [dice.choice(TEXTS), 0], [0, '1/0']))
        return
    number, _, unit = str(old).partition(' ')
    factor = dice.choice((0, -1, 0.01, 0.5, 0.9, 1.1, 2, 5, 100, 1e6, 1e-6, 1e25))
    try:
        new = float(number) * factor
    except ValueError:
        return
    holder[path[-1]] = f'{new:g} {unit}' if unit else round(new) if isinstance(old, int) else new


def scramble(dice: random.Random, text: str) -> bytes:
    """Damage the text of a scene, whatever it means."""
    data = bytearray(text.encode('utf-8'))
    for _ in range(dice.choice((1, 2, 5, 20))):
        at = dice.randrange(len(data))
        what = dice.randrange(5)
        if what == 0:
            data[at] = dice.randrange(256)
        elif what == 1:
            del data[at : at + dice.randrange(1, 40)]
        elif what == 2:
            data[at:at] = data[at : at + dice.randrange(1, 80)]
        elif what == 3:
            data[at:at] = dice.choice(
                (b'{', b'[', b': ', b'\n', b'- ', b'*a', b'&a ', b'!!', b'"', b'<<: ')
            )
        else:
            data[at:at] = dice.choice(RAW).encode('utf-8', 'surrogatepass')
        data = data or bytearray(b' ')
    return bytes(data)


def broken_file(seed: int, files: list[Path] = SCENES) -> bytes:
    """A damaged file, the same for the same seed."""
    dice = random.Random(seed)
    text = dice.choice(files).read_text(encoding='utf-8')
    what = dice.randrange(10)
    if what == 0:
        return scramble(dice, text)
    if what == 1:
        return (text + '\n' + dice.choice(RAW)).encode('utf-8', 'surrogatepass')
    if what == 2:
        return dice.choice(RAW).encode('utf-8', 'surrogatepass')
    data = yaml.safe_load(text)
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        (damage if what < 6 else detune)(dice, data)
    return yaml.dump(data, sort_keys=False).encode('utf-8', 'surrogatepass')
