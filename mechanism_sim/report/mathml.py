"""A machine's equations as a page whose formulas browsers set by themselves, as MathML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from html import escape
from typing import Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from mechanism_sim.report.derivation import Equation, MachineEquations
from mechanism_sim.report.symbols import Expression, Symbol

_GREEK = {
    r'\theta': 'θ', r'\lambda': 'λ', r'\tau': 'τ', r'\sigma': 'σ',
}  # fmt: skip
_STYLE = (
    'body{font-family:sans-serif;max-width:70em;margin:2em auto;padding:0 1em}'
    'td{padding:0 1em 0 0}math{margin:.4em 0}'
)


class _MathML(MathMLPresentationPrinter):  # type: ignore[misc]
    """Presentation MathML with the symbols of the equations."""

    def __init__(self, symbols: Iterable[Symbol]) -> None:
        super().__init__()
        self._markup = {s.symbol.name: symbol(s) for s in symbols}

    def _print_Symbol(self, sym: Any, style: str = 'plain') -> Any:
        letter = self.dom.createElement('mi')
        letter.appendChild(self.dom.createTextNode(sym.name))
        return letter

    def set(self, expression: Expression) -> str:
        """An expression."""
        return re.sub(
            r'<mi>(\w+)</mi>', lambda m: self._markup.get(m[1], m[0]), self.doprint(expression)
        )


def symbol(known: Symbol) -> str:
    """A symbol: its letter with dots, its indices below."""
    stem, _, index = known.latex.partition('_')
    dotted = re.fullmatch(r'\\(d*dot)\{(.+)\}', stem)
    letter = dotted[2] if dotted else stem
    letter, _, power = letter.partition('^')
    base = f'<mi>{_GREEK.get(letter, letter)}</mi>'
    if power:
        base = f'<msup>{base}<mn>{power}</mn></msup>'
    if dotted:
        dots = '˙' if dotted[1] == 'dot' else '¨'
        base = f'<mover accent="true">{base}<mo>{dots}</mo></mover>'
    below = re.sub(r'\\mathrm|[{}\\]', '', index).replace(',', ', ').replace('  ', ' ')
    return f'<msub>{base}<mtext>{escape(below)}</mtext></msub>' if below else base


def page(equations: MachineEquations, tables: list[tuple[str, tuple[Symbol, ...]]]) -> str:
    """The page, which needs no other file."""
    listed = [s for triple in equations.coordinates for s in triple]
    listed += [*equations.parameters, *equations.variables]
    printer = _MathML(listed)
    out = [
        '<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
        f'<title>{escape(equations.title)}</title><style>{_STYLE}</style></head><body>',
        f'<h1>{escape(equations.title)}</h1>',
        f'<p>Scene <code>{escape(equations.scene)}</code>, level {escape(equations.level)}.</p>',
    ]  # fmt: skip
    for heading, symbols in tables:
        out += [f'<h2>{heading}</h2>', '<table>']
        for s in symbols:
            value = '' if s.value is None else repr(s.value)
            out.append(
                f'<tr><td><math>{symbol(s)}</math></td><td>{value} {escape(s.unit)}</td>'
                f'<td>{escape(s.meaning)}</td></tr>'
            )
        out.append('</table>')
    for part in equations.parts:
        out.append(f'<h2>{escape(part.heading)}</h2>')
        for e in part.equations:
            out.append(f'<math display="block"><mrow>{"".join(_set(printer, e))}</mrow></math>')
            out += [f'<p>{escape(e.note)}</p>'] if e.note else []
        out += [f'<p>{escape(text)}</p>' for text in part.notes]
    return '\n'.join([*out, '</body></html>', ''])


def _set(printer: _MathML, equation: Equation) -> Iterator[str]:
    """Both sides, term by term in their order."""
    for side, between in ((equation.left, ''), (equation.right, '<mo>=</mo>')):
        yield between
        for k, term in enumerate(side):
            negative = bool(sympy.sympify(term).could_extract_minus_sign())
            if k or negative:
                yield '<mo>-</mo>' if negative else '<mo>+</mo>'
            yield printer.set(-term if negative else term)
