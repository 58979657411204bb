"""Equations as text, LaTeX, Markdown, JSON, and pages of MathML; needs sympy."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from html import escape
from typing import Any

import sympy
from sympy.printing.latex import LatexPrinter
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.str import StrPrinter

from mechanism_sim import output
from mechanism_sim.arguments import public
from mechanism_sim.report.derivation import Equation, MachineEquations, derive
from mechanism_sim.report.symbols import Expression, Symbol
from mechanism_sim.scene import Source, load_scene
from mechanism_sim.units import unrounded

_GREEK = {
    r'\theta': 'θ', r'\lambda': 'λ', r'\tau': 'τ', r'\sigma': 'σ',
}  # fmt: skip
_STYLE = (
    'body{font-family:sans-serif;max-width:70em;margin:2em auto;padding:0 1em}'
    'td{padding:0 1em 0 0}math{margin:.4em 0}'
)
_LINE = 150  # characters of text that fit beside each other in a LaTeX line


class _Text(StrPrinter):  # type: ignore[misc]
    """Text that Python and sympy read, to the last digit that is not rounding."""

    def _print_Float(self, expr: Any) -> str:
        return repr(unrounded(float(expr)))


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _print_Float(self, expr: Any) -> str:
        mantissa, _, exponent = repr(unrounded(float(expr))).partition('e')
        return rf'{mantissa} \cdot 10^{{{int(exponent)}}}' if exponent else mantissa


class Typesetter:
    """The equations of a machine in every form.

    ``text`` is what Python and sympy can read.
    """

    def __init__(self, equations: MachineEquations) -> None:
        self.equations = equations
        moving = [s for triple in equations.coordinates for s in triple]
        self._listed = (*moving, *equations.parameters, *equations.variables)
        # every form needs the text, if only for its length; a law of a cam takes seconds
        self._text = cache(_Text().doprint)
        names = {s.symbol: s.latex for s in self._listed}
        self._latex = cache(_Latex({'symbol_names': names}).doprint)

    def equation_text(self, equation: Equation) -> str:
        """``left = right``."""
        return ' = '.join(
            ' '.join(_signed([self._text(x) for x in side]))
            for side in (equation.left, equation.right)
        )

    def equation_latex(self, equation: Equation) -> str:
        """``left = right``, broken into lines for ``split``."""
        lines, length = ['& '], 0
        for side, between in ((equation.left, ''), (equation.right, '= ')):
            terms = _signed([self._latex(x) for x in side])
            terms[0] = between + terms[0]
            for term, expression in zip(terms, side, strict=True):
                size = len(self._text(expression))
                if length and length + size > _LINE:
                    lines.append(r'&\quad ')
                    length = 0
                lines[-1] += f'{term} '
                length += size
        return ' \\\\\n'.join(line.strip() for line in lines)

    def plain(self, width: int = 99) -> str:
        """Equations for a terminal, as Python and sympy read them, but for line breaks."""
        eq = self.equations
        lines = [f'{eq.scene}: {eq.title}', f'level: {eq.level}']
        for heading, symbols in self._tables():
            lines += ['', heading]
            rows = [(s.symbol.name, ' '.join(_value(s)).strip(), s.meaning) for s in symbols]
            wide = [max(len(row[i]) for row in rows) for i in (0, 1)]
            lines += [f'  {a:{wide[0]}}  {b:{wide[1]}}  {c}' for a, b, c in rows]
        for part in eq.parts:
            lines += ['', part.heading]
            for e in part.equations:
                note = f'  ({e.note})' if e.note else ''
                lines += _wrapped(self.equation_text(e) + note, width)
            for text in part.notes:
                lines += _wrapped(text, width)
        return '\n'.join(lines)

    def latex(self) -> str:
        """A fragment that needs the packages amsmath and longtable."""
        eq = self.equations
        out = ['% needs the packages amsmath and longtable', rf'\section*{{{_escaped(eq.title)}}}']
        for heading, symbols in self._tables():
            out += [rf'\subsection*{{{heading}}}', r'\begin{longtable}{lll}']
            for s in symbols:
                value, unit = _value(s)
                number = self._latex(sympy.Float(s.value)) if value else ''
                spaced = unit.replace(' ', r'\,')
                quantity = rf'${number}\;\mathrm{{{spaced}}}$'
                out.append(rf'${s.latex}$ & {quantity} & {_escaped(s.meaning)} \\')
            out.append(r'\end{longtable}')
        for part in eq.parts:
            out.append(rf'\subsection*{{{_escaped(part.heading)}}}')
            for e in part.equations:
                note = rf'\qquad \text{{{_escaped(e.note)}}}' if e.note else ''
                body = self.equation_latex(e)
                out.append(f'\\begin{{equation}}\n\\begin{{split}}\n{body}{note}')
                out.append('\\end{split}\n\\end{equation}')
            out += [rf'\noindent {_escaped(text)}\par' for text in part.notes]
        return '\n'.join(out) + '\n'

    def document(self) -> str:
        """A whole LaTeX document."""
        return (
            '\\documentclass[a4paper]{article}\n'
            '\\usepackage{amsmath,longtable}\n\\usepackage[margin=2cm]{geometry}\n'
            f'\\begin{{document}}\n{self.latex()}\\end{{document}}\n'
        )

    def markdown(self) -> str:
        """Equations as Markdown, with formulas between dollar signs."""
        eq = self.equations
        out = [f'# {eq.title}', '', f'Scene `{eq.scene}`, level {eq.level}.']
        for heading, symbols in self._tables():
            out += ['', f'## {heading}', '', '| symbol | value | meaning |', '|---|---|---|']
            out += [f'| ${s.latex}$ | {" ".join(_value(s))} | {s.meaning} |' for s in symbols]
        for part in eq.parts:
            out += ['', f'## {part.heading}']
            for e in part.equations:
                body = self.equation_latex(e)
                out += ['', '$$', f'\\begin{{split}}\n{body}\n\\end{{split}}', '$$']
                out += ['', e.note] if e.note else []
            out += [line for text in part.notes for line in ('', text)]
        return '\n'.join(out) + '\n'

    def html(self) -> str:
        """A page with formulas as MathML, which needs no other file."""
        eq, printer = self.equations, _MathML(self._listed)
        out = [
            '<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
            f'<title>{escape(eq.title)}</title><style>{_STYLE}</style></head><body>',
            f'<h1>{escape(eq.title)}</h1>',
            f'<p>Scene <code>{escape(eq.scene)}</code>, level {escape(eq.level)}.</p>',
        ]  # fmt: skip
        for heading, symbols in self._tables():
            out += [f'<h2>{heading}</h2>', '<table>']
            for s in symbols:
                out.append(
                    f'<tr><td><math>{_marked(s)}</math></td><td>{escape(" ".join(_value(s)))}</td>'
                    f'<td>{escape(s.meaning)}</td></tr>'
                )
            out.append('</table>')
        for part in eq.parts:
            out.append(f'<h2>{escape(part.heading)}</h2>')
            for e in part.equations:
                set_ = ''.join(printer.equation(e))
                out.append(f'<math display="block"><mrow>{set_}</mrow></math>')
                out += [f'<p>{escape(e.note)}</p>'] if e.note else []
            out += [f'<p>{escape(text)}</p>' for text in part.notes]
        return '\n'.join([*out, '</body></html>', ''])

    def _repr_latex_(self) -> str:
        """Equations as LaTeX for notebooks: every part with its heading."""
        rows = []
        for part in self.equations.parts:
            rows.append(rf'& \text{{{_escaped(part.heading)}:}}')
            rows += [self.equation_latex(e) for e in part.equations]
        body = ' \\\\\n'.join(rows)
        return f'$$\n\\begin{{aligned}}\n{body}\n\\end{{aligned}}\n$$'

    def __str__(self) -> str:
        return self.plain()

    def to_json(self) -> dict[str, object]:
        """Symbols, and every part as a list of equations."""
        eq = self.equations
        coordinates = [
            {**_symbol(q), 'rate': v.symbol.name, 'acceleration': a.symbol.name}
            for q, v, a in eq.coordinates
        ]
        parts = {
            part.name: [
                {
                    'name': e.name,
                    'latex': self.equation_latex(e),
                    'text': self.equation_text(e),
                    **({'note': e.note} if e.note else {}),
                }
                for e in part.equations
            ]
            for part in eq.parts
        }
        notes = {part.name: list(part.notes) for part in eq.parts if part.notes}
        return {
            'scene': eq.scene,
            'title': eq.title,
            'level': eq.level,
            'coordinates': coordinates,
            'parameters': [_symbol(s) for s in eq.parameters],
            'variables': [_symbol(s) for s in eq.variables],
            **parts,
            'notes': notes,
        }

    def _tables(self) -> Iterator[tuple[str, tuple[Symbol, ...]]]:
        eq = self.equations
        for heading, symbols in (
            ('Coordinates', tuple(q for q, _, _ in eq.coordinates)),
            ('Parameters', eq.parameters),
            ('Forces and other quantities', eq.variables),
        ):
            if symbols:
                yield heading, symbols


def _symbol(s: Symbol) -> dict[str, object]:
    """A symbol as JSON; only parameters have a value."""
    value = {} if s.value is None else {'value': s.value}
    return {
        'name': s.name, 'latex': s.latex, 'text': s.symbol.name, 'meaning': s.meaning,
        'unit': s.unit, **value,
    }  # fmt: skip


def _signed(terms: list[str]) -> list[str]:
    """Terms of a sum with the signs between them."""
    rest = [f'- {t[1:].lstrip()}' if t.startswith('-') else f'+ {t}' for t in terms[1:]]
    return [*terms[:1], *rest]


def _value(s: Symbol) -> tuple[str, str]:
    """Value and unit as text."""
    return '' if s.value is None else repr(unrounded(s.value)), s.unit


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(
        text, width, initial_indent='  ', subsequent_indent='      ', break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


_SPECIAL = {'>=': r'$\ge$', '<=': r'$\le$', '<': '$<$', '>': '$>$', '|': '$|$', '^': r'\^{}',
            '\\': r'\textbackslash{}', '~': r'\~{}'}  # fmt: skip


def _escaped(text: str) -> str:
    """Words for LaTeX."""
    return re.sub(
        r'>=|<=|[<>|^\\~_&%#{}$]', lambda m: _SPECIAL.get(m.group(), rf'\{m.group()}'), text
    )


@public
def equations(scene: Source, rates: bool = False) -> Typesetter:
    """The equations of a machine, from what is compiled, as `check --equations` has them.

    A notebook sets them; ``print`` writes them as text that Python and sympy read; ``latex()``,
    ``markdown()``, ``html()``, ``to_json()`` are the other forms.

    >>> import mechanism_sim as ms
    >>> print(ms.equations('pendulum').plain().splitlines()[0])
    pendulum: Pendulum

    Parameters
    ----------
    scene : all that `load_scene` takes
    rates : add the first and second derivatives of closures and gaps
    """
    return Typesetter(derive(load_scene(scene), rates))


_FORMS: dict[str, Callable[[Typesetter], str]] = {
    '.txt': lambda t: t.plain() + '\n',
    '.tex': Typesetter.document,
    '.md': Typesetter.markdown,
    '.html': Typesetter.html,
}


def write(setter: Typesetter, file: str) -> None:
    """Write a file in the format of its ending: .tex (a document), .md, .html or .txt."""
    path = output.check_path('--output', file, *_FORMS, new=True)
    output.write_text(path, _FORMS[path.suffix](setter))


class _MathML(MathMLPresentationPrinter):  # type: ignore[misc]
    """Presentation MathML with the symbols of the equations."""

    def __init__(self, symbols: Iterable[Symbol]) -> None:
        super().__init__()
        self._markup = {s.symbol.name: _marked(s) for s in symbols}

    def _print_Symbol(self, sym: Any, style: str = 'plain') -> Any:
        letter = self.dom.createElement('mi')
        letter.appendChild(self.dom.createTextNode(sym.name))
        return letter

    def set(self, expression: Expression) -> str:
        """An expression."""
        return re.sub(
            r'<mi>(\w+)</mi>', lambda m: self._markup.get(m[1], m[0]), self.doprint(expression)
        )

    def equation(self, equation: Equation) -> Iterator[str]:
        """Yield both sides, term by term in their order."""
        for side, between in ((equation.left, ''), (equation.right, '<mo>=</mo>')):
            yield between
            for k, term in enumerate(side):
                negative = bool(sympy.sympify(term).could_extract_minus_sign())
                if k or negative:
                    yield '<mo>-</mo>' if negative else '<mo>+</mo>'
                yield self.set(-term if negative else term)


def _marked(known: Symbol) -> str:
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
