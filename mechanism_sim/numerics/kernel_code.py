"""LLVM's text of kernels: Python of a small part, with the types of what it is called with.

There are numbers, arrays of one or two axes whose rows are contiguous, and (named) tuples of them;
functions that are kernels themselves, each written once for every kind of arguments; other machine
code by its address (`call_code`); variables that keep their kind; loops over ranges, vectors and
tuples. Everything else of Python is refused by a `KeyError` or `TypeError`. Operations are those
of double precision, one by one: nothing may be reordered or fused. Indices are not checked, and a
division by zero is that of IEEE 754.

A value is a `Number`, an `ArrayView` or `Several`; the parts of it that LLVM knows are its leaves.
What arrays take is kept until the entry returns, in a list that starts at ``@kept``.
"""

from __future__ import annotations

import ast
import builtins
import ctypes
import inspect
import math
import struct
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, reduce
from types import CodeType, FunctionType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array

_LLVM = {'f': 'double', 'i': 'i64', 'b': 'i1'}
_STORED = {'f': 'double', 'i': 'i64', 'b': 'i8'}
_SIZES = {'f': 8, 'i': 8, 'b': 1}

FRAME = """
@kept = internal global ptr null
declare ptr @malloc(i64)
declare void @free(ptr)
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)
declare double @llvm.fabs.f64(double)
declare double @llvm.sqrt.f64(double)
define internal ptr @take(i64 %size) {
  %all = add i64 %size, 16
  %new = call ptr @malloc(i64 %all)
  %last = load ptr, ptr @kept
  store ptr %last, ptr %new
  store ptr %new, ptr @kept
  %at = getelementptr i8, ptr %new, i64 16
  ret ptr %at
}
define void @release() {
  br label %next
next:
  %at = load ptr, ptr @kept
  %none = icmp eq ptr %at, null
  br i1 %none, label %end, label %more
more:
  %before = load ptr, ptr %at
  store ptr %before, ptr @kept
  call void @free(ptr %at)
  br label %next
end:
  ret void
}
"""


class Number(NamedTuple):
    """A number: f, i or b for float, integer, boolean; and LLVM's name of it."""

    kind: str
    text: str


class ArrayView(NamedTuple):
    """An array, by what it is of, its address, shape and the distance of its rows."""

    kind: str
    at: str
    shape: tuple[str, ...]
    stride: str


class Several(NamedTuple):
    """A tuple; of a named one its class."""

    items: tuple[Any, ...]
    maker: type | None = None


Value: TypeAlias = Number | ArrayView | Several
Type: TypeAlias = Any
"""Hashable: 'f', 'i', 'b'; ('f', 2) of an array; (maker, types) of a tuple; None of nothing."""


def type_of(value: Value | None) -> Type:
    """Type of a value."""
    if isinstance(value, Number):
        return value.kind
    if isinstance(value, ArrayView):
        return value.kind, len(value.shape)
    return value and (value.maker, tuple(map(type_of, value.items)))


def kinds(known: Type) -> list[str]:
    """LLVM's types of the leaves of a type."""
    if known is None:
        return []
    if isinstance(known, str):
        return [_LLVM[known]]
    first, second = known
    if isinstance(first, str):
        return ['ptr', *('i64',) * (1 if second == 1 else 3)]
    return [x for item in second for x in kinds(item)]


def _leaves(value: Value | None) -> list[str]:
    if value is None:
        return []
    if isinstance(value, Number):
        return [value.text]
    if isinstance(value, ArrayView):
        return [value.at, *value.shape, *([value.stride] if len(value.shape) > 1 else [])]
    return [x for item in value.items for x in _leaves(item)]


def _value(known: Type, texts: Iterator[str]) -> Any:
    """The value of a type with some leaves."""
    if known is None:
        return None
    if isinstance(known, str):
        return Number(known, next(texts))
    first, second = known
    if isinstance(first, str):
        at = next(texts)
        shape = tuple(next(texts) for _ in range(second))
        return ArrayView(first, at, shape, next(texts) if second > 1 else '1')
    return Several(tuple(_value(item, texts) for item in second), first)


def _constant(known: Any) -> Value:
    """Value of an object of Python."""
    if isinstance(known, tuple):
        maker = type(known) if hasattr(known, '_fields') else None
        return Several(tuple(map(_constant, known)), maker)
    return _number(known)


def _number(known: float) -> Number:
    if isinstance(known, bool | np.bool_):
        return Number('b', 'true' if known else 'false')
    if isinstance(known, int | np.integer):
        return Number('i', str(int(known)))
    return Number('f', f'0x{struct.pack(">d", known).hex().upper()}')


_ZERO = {'f': _number(0.0), 'i': _number(0), 'b': _number(False)}
_ONE = {'f': _number(1.0), 'i': _number(1), 'b': _number(True)}


class Module:
    """The text of an entry and of all that it calls.

    Parameters
    ----------
    function_of : the function of a kernel, None of what is none
    """

    def __init__(self, function_of: Callable[[Any], FunctionType | None]) -> None:
        self.function_of = function_of
        self._known: dict[tuple[FunctionType, tuple[Type, ...]], tuple[str, Type]] = {}
        self._texts = [FRAME]

    def symbol(self, function: FunctionType, types: tuple[Type, ...]) -> tuple[str, Type]:
        """Name of a function for arguments of some types, and the type of what it returns."""
        key = function, types
        if key not in self._known:
            name = f'@{function.__name__}.{len(self._known)}'
            self._known[key] = name, None
            body = _Body(self, function, types)
            self._texts.append(body.text(name))
            self._known[key] = name, body.result
        return self._known[key]

    def entry(self, function: FunctionType, types: tuple[Type, ...]) -> tuple[str, Type]:
        """The whole text, and the type that ``enter(arguments, results)`` returns.

        Both are leaves behind each other, of 8 bytes each.
        """
        name, result = self.symbol(function, types)
        lines, given = [], []
        for k, kind in enumerate(x for known in types for x in kinds(known)):
            stored = 'i64' if kind == 'i1' else kind
            lines.append(f'  %p{k} = getelementptr i64, ptr %arguments, i64 {k}')
            lines.append(f'  %a{k} = load {stored}, ptr %p{k}')
            if kind == 'i1':
                lines.append(f'  %b{k} = trunc i64 %a{k} to i1')
            given.append(f'{kind} %{"b" if kind == "i1" else "a"}{k}')
        call = f'  call void {name}({", ".join([*given, "ptr %results"])})'
        if 'ptr' not in kinds(result):
            call += '\n  call void @release()'
        head = 'define void @enter(ptr %arguments, ptr %results) {'
        return '\n'.join([*self._texts, head, *lines, call, '  ret void', '}']), result


class _Writer:
    """Instructions of a function, in blocks; its variables are in memory."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.slots: list[str] = []
        self.loops: list[tuple[str, str]] = []
        self._count = 0

    def new(self, instruction: str) -> str:
        """Name of what an instruction gives."""
        self._count += 1
        self.lines.append(f'  %v{self._count} = {instruction}')
        return f'%v{self._count}'

    def do(self, instruction: str) -> None:
        """Write an instruction that gives nothing."""
        self.lines.append(f'  {instruction}')

    def slot(self, kind: str) -> str:
        """Address of a variable of one of LLVM's types."""
        self.slots.append(f'  %s{len(self.slots)} = alloca {kind}')
        return f'%s{len(self.slots) - 1}'

    def label(self) -> str:
        """Name of a block to come."""
        self._count += 1
        return f'b{self._count}'

    def begin(self, label: str) -> None:
        """Go on in a block, after what was written before."""
        self.do(f'br label %{label}')
        self.lines.append(f'{label}:')

    def leave(self, instruction: str) -> None:
        """End a block: what follows belongs to another."""
        self.do(instruction)
        self.lines.append(f'{self.label()}:')

    def split(self, condition: Number) -> tuple[str, str]:
        """Go on in a block if a condition holds; labels of where else, and of where both meet."""
        then, other, end = self.label(), self.label(), self.label()
        self.do(f'br i1 {condition.text}, label %{then}, label %{other}')
        self.lines.append(f'{then}:')
        return other, end

    def otherwise(self, other: str, end: str) -> None:
        """Go on where the condition does not hold."""
        self.do(f'br label %{end}')
        self.lines.append(f'{other}:')

    @contextmanager
    def counted(self, low: str, high: str, step: int = 1) -> Iterator[str]:
        """A loop from one number to another, exclusive; gives the number."""
        slot, test, body, more, end = self.slot('i64'), *(self.label() for _ in range(4))
        self.do(f'store i64 {low}, ptr {slot}')
        self.begin(test)
        at = self.new(f'load i64, ptr {slot}')
        goes = self.new(f'icmp {"slt" if step > 0 else "sgt"} i64 {at}, {high}')
        self.do(f'br i1 {goes}, label %{body}, label %{end}')
        self.lines.append(f'{body}:')
        self.loops.append((more, end))
        yield at
        self.loops.pop()
        self.begin(more)
        self.do(f'store i64 {self.new(f"add i64 {at}, {step}")}, ptr {slot}')
        self.do(f'br label %{test}')
        self.lines.append(f'{end}:')


class _Body(_Writer):
    """A function as it is written, from its first statement to its last."""

    def __init__(self, module: Module, function: FunctionType, types: tuple[Type, ...]) -> None:
        super().__init__()
        self.module, self.globals = module, function.__globals__
        self.result: Type = None
        self._returns = False
        self._names: dict[str, tuple[Type, list[str]]] = {}
        kept = iter(range(10**6))
        given = [_value(t, iter([f'%a{next(kept)}' for _ in kinds(t)])) for t in types]
        self._head = [
            f'{kind} {leaf}'
            for value in given
            for kind, leaf in zip(kinds(type_of(value)), _leaves(value), strict=True)
        ]
        tree = _tree(function)
        names = [a.arg for a in tree.args.args]
        if tree.args.vararg:
            given[len(names) :] = [Several(tuple(given[len(names) :]))]
            names.append(tree.args.vararg.arg)
        for name, value in zip(names, given, strict=True):
            self.assign(name, value)
        self.statements(tree.body)

    def text(self, name: str) -> str:
        """LLVM text of the function under a name."""
        head = ', '.join([*self._head, 'ptr %results'])
        return '\n'.join(
            [
                f'define internal void {name}({head}) {{',
                *self.slots,
                *self.lines,
                '  ret void',
                '}',
            ]
        )

    # --- numbers and arrays -------------------------------------------------------------------

    def cast(self, x: Number, kind: str) -> Number:
        """A number as one of another kind; as a boolean, if it is not 0."""
        if x.kind == kind:
            return x
        if kind == 'b':
            how = 'fcmp une double' if x.kind == 'f' else 'icmp ne i64'
            return Number('b', self.new(f'{how} {x.text}, {_ZERO[x.kind].text}'))
        how = {'bi': 'zext', 'bf': 'uitofp', 'if': 'sitofp', 'fi': 'fptosi'}[x.kind + kind]
        return Number(kind, self.new(f'{how} {_LLVM[x.kind]} {x.text} to {_LLVM[kind]}'))

    def alike(self, *numbers: Number) -> list[Number]:
        """Numbers as such of the widest kind among them."""
        widest = max((x.kind for x in numbers), key='bif'.index)
        return [self.cast(x, widest) for x in numbers]

    def load(self, kind: str, at: str) -> Number:
        """Element at an address."""
        found = self.new(f'load {_STORED[kind]}, ptr {at}')
        return Number(kind, found) if kind != 'b' else self.cast_byte(found)

    def cast_byte(self, byte: str) -> Number:
        """Boolean that is kept in a byte."""
        return Number('b', self.new(f'icmp ne i8 {byte}, 0'))

    def store(self, x: Number, kind: str, at: str) -> None:
        """Set an element at an address."""
        text = self.cast(x, kind).text
        if kind == 'b':
            text = self.new(f'zext i1 {text} to i8')
        self.do(f'store {_STORED[kind]} {text}, ptr {at}')

    def place(self, array: ArrayView, indices: Sequence[Number | tuple[str, str]]) -> ArrayView:
        """Part of an array by index or slice of each axis; without axes it is one element."""
        offset, shape, strides = '0', [], []
        steps = (array.stride, '1')[-len(array.shape) :]
        for axis, stride in enumerate(steps):
            index = indices[axis] if axis < len(indices) else ('0', array.shape[axis])
            if isinstance(index, Number):
                low = self.cast(index, 'i').text
            else:
                low, high = index
                size = high if low == '0' else self.new(f'sub i64 {high}, {low}')
                shape.append(size)
                strides.append(stride)
            if low != '0':
                moved = low if stride == '1' else self.new(f'mul i64 {low}, {stride}')
                offset = moved if offset == '0' else self.new(f'add i64 {offset}, {moved}')
        if strides and strides[-1] != '1':
            raise TypeError('columns are not contiguous')
        at = self.new(f'getelementptr {_STORED[array.kind]}, ptr {array.at}, i64 {offset}')
        return ArrayView(array.kind, at, tuple(shape), strides[0] if len(strides) > 1 else '1')

    def made(self, kind: str, shape: Sequence[str], zero: bool = False) -> ArrayView:
        """A new array."""
        count = reduce(lambda a, b: self.new(f'mul i64 {a}, {b}'), shape)
        size = self.new(f'mul i64 {count}, {_SIZES[kind]}')
        at = self.new(f'call ptr @take(i64 {size})')
        if zero:
            self.do(f'call void @llvm.memset.p0.i64(ptr {at}, i8 0, i64 {size}, i1 false)')
        return ArrayView(kind, at, tuple(shape), shape[-1] if len(shape) > 1 else '1')

    def fill(self, array: ArrayView, value: Number | ArrayView) -> None:
        """Set an array to a number, or to another array."""
        with self.counted('0', array.shape[0]) as i:
            at = Number('i', i)
            row = self.place(array, [at])
            part = self.place(value, [at]) if isinstance(value, ArrayView) else value
            if row.shape:
                self.fill(row, part)
            else:
                found = self.load(part.kind, part.at) if isinstance(part, ArrayView) else part
                self.store(found, array.kind, row.at)

    # --- variables ----------------------------------------------------------------------------

    def has(self, name: str) -> bool:
        """True of a variable, not of what the module knows."""
        return name in self._names

    def variable(self, name: str) -> Any:
        """Value of a variable."""
        return self.kept(*self._names[name])

    def kept(self, known: Type, slots: Sequence[str]) -> Any:
        """The value of a type whose leaves are in variables of LLVM."""
        loads = zip(kinds(known), slots, strict=True)
        return _value(known, iter([self.new(f'load {k}, ptr {s}') for k, s in loads]))

    def keep(self, value: Value, slots: Sequence[str]) -> None:
        """Set them."""
        for kind, leaf, slot in zip(kinds(type_of(value)), _leaves(value), slots, strict=True):
            self.do(f'store {kind} {leaf}, ptr {slot}')

    def assign(self, name: str, value: Value) -> None:
        """Set a variable, whose first value says of which type it is."""
        if name not in self._names:
            known = type_of(value)
            self._names[name] = known, [self.slot(kind) for kind in kinds(known)]
        known, slots = self._names[name]
        if isinstance(value, Number) and isinstance(known, str):
            if 'bif'.index(value.kind) > 'bif'.index(known):
                raise TypeError(f'{name} changes its kind from {known} to {value.kind}')
            value = self.cast(value, known)
        if type_of(value) != known:
            raise TypeError(f'{name} changes its type from {known} to {type_of(value)}')
        self.keep(value, slots)

    def call(self, function: FunctionType, arguments: Sequence[Value]) -> Any:
        """Result of a call."""
        name, result = self.module.symbol(function, tuple(map(type_of, arguments)))
        given = [
            f'{kind} {leaf}'
            for x in arguments
            for kind, leaf in zip(kinds(type_of(x)), _leaves(x), strict=True)
        ]
        wanted = kinds(result)
        results = self.slot(f'[{len(wanted)} x i64]')
        self.do(f'call void {name}({", ".join([*given, f"ptr {results}"])})')
        texts = []
        for k, kind in enumerate(wanted):
            at = self.new(f'getelementptr i64, ptr {results}, i64 {k}')
            byte = self.new(f'load {"i8" if kind == "i1" else kind}, ptr {at}')
            texts.append(self.cast_byte(byte).text if kind == 'i1' else byte)
        return _value(result, iter(texts))

    def give(self, value: Value | None) -> None:
        """Return a value."""
        known = type_of(value)
        if self._returns and known != self.result:
            raise TypeError(f'what is returned changes its type from {self.result} to {known}')
        self.result, self._returns = known, True
        for k, (kind, leaf) in enumerate(zip(kinds(known), _leaves(value), strict=True)):
            at = self.new(f'getelementptr i64, ptr %results, i64 {k}')
            if kind == 'i1':
                self.store(Number('b', leaf), 'b', at)
            else:
                self.do(f'store {kind} {leaf}, ptr {at}')
        self.leave('ret void')

    # --- what is read -------------------------------------------------------------------------

    def statements(self, body: Sequence[ast.stmt]) -> None:
        """Write statements."""
        for node in body:
            _STATEMENTS[type(node)](self, node)

    def value(self, node: ast.expr) -> Any:
        """Value of an expression."""
        if isinstance(node, ast.Name | ast.Attribute) and not self._is_local(node):
            return _constant(self.constant(node))
        return _EXPRESSIONS[type(node)](self, node)

    def truth(self, node: ast.expr) -> Number:
        """Value of a condition."""
        return self.cast(self.value(node), 'b')

    def _is_local(self, node: ast.expr) -> bool:
        while isinstance(node, ast.Attribute):
            node = node.value
        return not isinstance(node, ast.Name) or self.has(node.id)

    def constant(self, node: ast.expr) -> Any:
        """Object of Python that names and numbers stand for; None of what is computed."""
        if isinstance(node, ast.Constant):
            return node.value
        if self._is_local(node):
            return None
        if isinstance(node, ast.Attribute):
            return getattr(self.constant(node.value), node.attr)
        (name,) = (x.id for x in ast.walk(node) if isinstance(x, ast.Name))
        return self.globals[name] if name in self.globals else getattr(builtins, name)


@cache
def _tree(function: FunctionType) -> ast.FunctionDef:
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (found,) = tree.body
    own = [x for x in compile(tree, '', 'exec').co_consts if isinstance(x, CodeType)]
    # the file may have been edited since it was imported
    if not isinstance(found, ast.FunctionDef) or not _is_same(own[0], function.__code__):
        raise TypeError(f'{function.__name__} is not what its source says')
    return found


def _is_same(one: CodeType, other: CodeType) -> bool:
    known = 'co_consts', 'co_names', 'co_varnames'  # code may have other jumps
    return all(getattr(one, x) == getattr(other, x) for x in known)


# --- statements -------------------------------------------------------------------------------


def _set(body: _Body, target: ast.expr, value: Any) -> None:
    if isinstance(target, ast.Name):
        body.assign(target.id, value)
    elif isinstance(target, ast.Tuple):
        for part, item in zip(target.elts, value.items, strict=True):
            _set(body, part, item)
    elif isinstance(target, ast.Subscript):
        _put(body, _part(body, target), value)


def _put(body: _Body, place: ArrayView, value: Any) -> None:
    if place.shape:
        body.fill(place, value)
    else:
        body.store(value, place.kind, place.at)


def _assign(body: _Body, node: ast.Assign) -> None:
    value = body.value(node.value)
    for target in node.targets:
        _set(body, target, value)


def _augment(body: _Body, node: ast.AugAssign) -> None:
    if isinstance(node.target, ast.Name):
        old = body.variable(node.target.id)
        body.assign(node.target.id, _operate(body, node.op, old, body.value(node.value)))
    else:
        place = _part(body, node.target)
        old = body.load(place.kind, place.at)
        _put(body, place, _operate(body, node.op, old, body.value(node.value)))


def _if(body: _Body, node: ast.If) -> None:
    other, end = body.split(body.truth(node.test))
    body.statements(node.body)
    body.otherwise(other, end)
    body.statements(node.orelse)
    body.begin(end)


def _for(body: _Body, node: ast.For) -> None:
    if isinstance(node.iter, ast.Call) and body.constant(node.iter.func) is range:
        given = node.iter.args
        step = ast.literal_eval(given[2]) if len(given) == 3 else 1
        low, high = ['0', *(body.value(x).text for x in given[:2])][-2:]
        with body.counted(low, high, step) as at:
            _set(body, node.target, Number('i', at))
            body.statements(node.body)
        return
    items = body.value(node.iter)
    if isinstance(items, Several):
        numbers = body.alike(*items.items)
        kind = numbers[0].kind
        slot = body.slot(f'[{len(numbers)} x {_STORED[kind]}]')
        items = ArrayView(kind, slot, (str(len(numbers)),), '1')
        for k, x in enumerate(numbers):
            body.store(x, kind, body.place(items, [Number('i', str(k))]).at)
    with body.counted('0', items.shape[0]) as at:
        element = body.place(items, [Number('i', at)])
        _set(body, node.target, body.load(element.kind, element.at))
        body.statements(node.body)


def _return(body: _Body, node: ast.Return) -> None:
    body.give(body.value(node.value) if node.value else None)


def _expression(body: _Body, node: ast.Expr) -> None:
    if not isinstance(node.value, ast.Constant):  # a docstring
        body.value(node.value)


_STATEMENTS: dict[type, Callable[[_Body, Any], None]] = {
    ast.Assign: _assign,
    ast.AugAssign: _augment,
    ast.If: _if,
    ast.For: _for,
    ast.Return: _return,
    ast.Expr: _expression,
    ast.Break: lambda body, _: body.leave(f'br label %{body.loops[-1][1]}'),
    ast.Continue: lambda body, _: body.leave(f'br label %{body.loops[-1][0]}'),
}


# --- expressions ------------------------------------------------------------------------------


def _attribute(body: _Body, node: ast.Attribute) -> Any:
    value = body.value(node.value)
    if isinstance(value, ArrayView) and node.attr == 'shape':
        return Several(tuple(Number('i', x) for x in value.shape))
    return value.items[value.maker._fields.index(node.attr)]


def _part(body: _Body, node: Any) -> ArrayView:
    """Element or part of an array."""
    array, at = body.value(node.value), node.slice
    found: list[Number | tuple[str, str]] = []
    for axis, index in enumerate(at.elts if isinstance(at, ast.Tuple) else [at]):
        if isinstance(index, ast.Slice):
            low = body.value(index.lower).text if index.lower else '0'
            found.append((low, body.value(index.upper).text if index.upper else array.shape[axis]))
        else:
            found.append(body.value(index))
    return body.place(array, found)


def _subscript(body: _Body, node: ast.Subscript) -> Any:
    if isinstance(index := body.constant(node.slice), int):
        value = body.value(node.value)
        if isinstance(value, Several):
            return value.items[index]
    place = _part(body, node)
    return place if place.shape else body.load(place.kind, place.at)


_OPERATORS = {
    ast.Add: 'add', ast.Sub: 'sub', ast.Mult: 'mul', ast.Div: 'div', ast.LShift: 'shl',
}  # fmt: skip


def _operate(body: _Body, how: ast.operator, a: Number, b: Number) -> Number:
    if isinstance(how, ast.Pow):
        if b.text != '2':
            raise TypeError('only squares are powers here')
        how, b = ast.Mult(), a
    a, b = body.alike(a, b)
    if a.kind == 'b' or isinstance(how, ast.Div):
        kind = 'f' if isinstance(how, ast.Div) else 'i'
        a, b = body.cast(a, kind), body.cast(b, kind)
    if isinstance(how, ast.Mod | ast.FloorDiv):
        return _divided(body, how, a, b)
    name = _OPERATORS[type(how)]
    name = name if a.kind == 'i' else f'f{name}'
    return Number(a.kind, body.new(f'{name} {_LLVM[a.kind]} {a.text}, {b.text}'))


def _divided(body: _Body, how: ast.operator, a: Number, b: Number) -> Number:
    """Remainder, with the sign of the divisor, or quotient rounded down."""
    kind = _LLVM[a.kind]
    rest, less, add, zero = (
        ('frem', 'fcmp olt', 'fadd', _ZERO['f'])
        if a.kind == 'f'
        else ('srem', 'icmp slt', 'add', _ZERO['i'])
    )
    left = body.new(f'{rest} {kind} {a.text}, {b.text}')
    # of which one is below zero: neither if the remainder is 0
    signs = [body.new(f'{less} {kind} {x}, {zero.text}') for x in (left, b.text)]
    some = body.cast(Number(a.kind, left), 'b').text
    differ = body.new(f'and i1 {some}, {body.new(f"xor i1 {signs[0]}, {signs[1]}")}')
    more = body.new(f'{add} {kind} {left}, {b.text}')
    left = body.new(f'select i1 {differ}, {kind} {more}, {kind} {left}')
    if isinstance(how, ast.Mod):
        return Number(a.kind, left)
    if a.kind == 'f':
        raise TypeError('only integers are divided with a remainder')
    whole = body.new(f'sub i64 {a.text}, {left}')
    return Number('i', body.new(f'sdiv i64 {whole}, {b.text}'))


def _unary(body: _Body, node: ast.UnaryOp) -> Number:
    if isinstance(node.op, ast.Not):
        return Number('b', body.new(f'xor i1 {body.truth(node.operand).text}, true'))
    x: Number = body.value(node.operand)
    if x.kind == 'f':
        return Number('f', body.new(f'fneg double {x.text}'))
    return Number('i', body.new(f'sub i64 0, {body.cast(x, "i").text}'))


_COMPARED: dict[type, tuple[str, str]] = {
    ast.Eq: ('oeq', 'eq'), ast.NotEq: ('une', 'ne'), ast.Lt: ('olt', 'slt'),
    ast.LtE: ('ole', 'sle'), ast.Gt: ('ogt', 'sgt'), ast.GtE: ('oge', 'sge'),
}  # fmt: skip


def _related(body: _Body, how: type, a: Number, b: Number) -> Number:
    a, b = body.alike(a, b)
    if a.kind == 'b':
        a, b = body.cast(a, 'i'), body.cast(b, 'i')
    real, whole = _COMPARED[how]
    test = f'fcmp {real}' if a.kind == 'f' else f'icmp {whole}'
    return Number('b', body.new(f'{test} {_LLVM[a.kind]} {a.text}, {b.text}'))


def _compare(body: _Body, node: ast.Compare) -> Any:
    values = [body.value(x) for x in (node.left, *node.comparators)]
    pairs = zip(node.ops, values, values[1:], strict=False)
    if isinstance(values[0], ArrayView):
        (how, a, b), *_ = pairs
        found = body.made('b', a.shape)
        with body.counted('0', a.shape[0]) as i:
            x, y, z = (body.place(v, [Number('i', i)]) for v in (a, b, found))
            same = _related(body, type(how), body.load(x.kind, x.at), body.load(y.kind, y.at))
            body.store(same, 'b', z.at)
        return found
    tests = [_related(body, type(how), a, b).text for how, a, b in pairs]
    return Number('b', reduce(lambda a, b: body.new(f'and i1 {a}, {b}'), tests))


def _all_or_any(body: _Body, node: ast.BoolOp) -> Number:
    found, end = body.slot('i1'), body.label()
    for k, part in enumerate(node.values):
        known = body.truth(part).text
        body.do(f'store i1 {known}, ptr {found}')
        if k < len(node.values) - 1:
            more = body.label()
            yes, no = (more, end) if isinstance(node.op, ast.And) else (end, more)
            body.do(f'br i1 {known}, label %{yes}, label %{no}')
            body.lines.append(f'{more}:')
    body.begin(end)
    return Number('b', body.new(f'load i1, ptr {found}'))


def _choice(body: _Body, node: ast.IfExp) -> Any:
    other, end = body.split(body.truth(node.test))
    one = body.value(node.body)
    at = len(body.lines)
    body.otherwise(other, end)
    two = body.value(node.orelse)
    kind = None
    if isinstance(one, Number):
        kind = max(one.kind, two.kind, key='bif'.index)
        two = body.cast(two, kind)
    slots = [body.slot(x) for x in kinds(type_of(two))]
    body.keep(two, slots)
    body.begin(end)
    lines, body.lines = body.lines, []
    body.keep(body.cast(one, kind) if kind else one, slots)
    body.lines = [*lines[:at], *body.lines, *lines[at:]]
    return body.kept(type_of(two), slots)


def _call(body: _Body, node: ast.Call) -> Any:
    known = body.constant(node.func)
    given: list[Any] = []
    for x in node.args:
        if isinstance(x, ast.Starred):
            given += body.value(x.value).items
        else:
            given.append(body.value(x))
    if isinstance(node.func, ast.Attribute) and known is None:  # of an array
        return _METHODS[node.func.attr](body, body.value(node.func.value), *given)
    function = body.module.function_of(known)
    if function is not None:
        return body.call(function, given)
    if isinstance(known, type) and hasattr(known, '_fields'):
        return Several(tuple(given), known)
    if known in _MAKERS:
        dtype = next((body.constant(k.value) for k in node.keywords), np.float64)
        return _MAKERS[known](body, given[0], np.dtype(dtype).kind)
    return _FUNCTIONS[known](body, *given)


_EXPRESSIONS: dict[type, Callable[[_Body, Any], Any]] = {
    ast.Name: lambda body, node: body.variable(node.id),
    ast.Constant: lambda _, node: _constant(node.value),
    ast.Tuple: lambda body, node: Several(tuple(body.value(x) for x in node.elts)),
    ast.BinOp: lambda body, node: _operate(
        body, node.op, body.value(node.left), body.value(node.right)
    ),
    ast.Attribute: _attribute,
    ast.Subscript: _subscript,
    ast.UnaryOp: _unary,
    ast.BoolOp: _all_or_any,
    ast.Compare: _compare,
    ast.IfExp: _choice,
    ast.Call: _call,
}


# --- functions --------------------------------------------------------------------------------


def _extreme(how: type) -> Callable[..., Number]:
    def of(body: _Body, *numbers: Number) -> Number:
        def better(a: Number, b: Number) -> Number:
            chosen = _related(body, how, b, a).text
            kind = _LLVM[a.kind]
            found = body.new(f'select i1 {chosen}, {kind} {b.text}, {kind} {a.text}')
            return Number(a.kind, found)

        return reduce(better, body.alike(*numbers))

    return of


def _size(body: _Body, x: Number) -> Number:
    if x.kind == 'f':
        return Number('f', body.new(f'call double @llvm.fabs.f64(double {x.text})'))
    less = body.new(f'icmp slt i64 {x.text}, 0')
    minus = body.new(f'sub i64 0, {x.text}')
    return Number('i', body.new(f'select i1 {less}, i64 {minus}, i64 {x.text}'))


def _root(body: _Body, x: Number) -> Number:
    text = body.cast(x, 'f').text
    return Number('f', body.new(f'call double @llvm.sqrt.f64(double {text})'))


def _joined(body: _Body, parts: Several) -> ArrayView:
    one, two = parts.items
    found = body.made(one.kind, [body.new(f'add i64 {one.shape[0]}, {two.shape[0]}')])
    body.fill(body.place(found, [('0', one.shape[0])]), one)
    body.fill(body.place(found, [(one.shape[0], found.shape[0])]), two)
    return found


def call_code(address: int, *arrays: Array) -> None:
    """Call machine code at an address with those of arrays, which it may change."""
    at = [x.ctypes.data for x in arrays]
    ctypes.CFUNCTYPE(None, *(ctypes.c_void_p for _ in at))(int(address))(*at)


def _call_code(body: _Body, address: Number, *arrays: ArrayView) -> None:
    code = body.new(f'inttoptr i64 {address.text} to ptr')
    body.do(f'call void {code}({", ".join(f"ptr {x.at}" for x in arrays)})')


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    call_code: _call_code,
    len: lambda _, x: Number('i', x.shape[0] if isinstance(x, ArrayView) else str(len(x.items))),
    abs: _size,
    max: _extreme(ast.Gt),
    min: _extreme(ast.Lt),
    bool: lambda body, x: body.cast(x, 'b'),
    int: lambda body, x: body.cast(x, 'i'),
    float: lambda body, x: body.cast(x, 'f'),
    math.sqrt: _root,
    math.isnan: lambda body, x: Number('b', body.new(f'fcmp uno double {x.text}, {x.text}')),
    np.concatenate: _joined,
}


def _shape(size: Number | Several) -> list[str]:
    return [x.text for x in size.items] if isinstance(size, Several) else [size.text]


def _ones(body: _Body, size: Number, kind: str) -> ArrayView:
    found = body.made(kind, _shape(size))
    body.fill(found, _ONE[kind])
    return found


def _range(body: _Body, size: Number, _: str) -> ArrayView:
    found = body.made('i', [size.text])
    with body.counted('0', size.text) as i:
        body.store(Number('i', i), 'i', body.place(found, [Number('i', i)]).at)
    return found


_MAKERS: dict[Any, Callable[..., ArrayView]] = {
    np.empty: lambda body, size, kind: body.made(kind, _shape(size)),
    np.zeros: lambda body, size, kind: body.made(kind, _shape(size), zero=True),
    np.ones: _ones,
    np.arange: _range,
}


def _copied(body: _Body, array: ArrayView) -> ArrayView:
    found = body.made(array.kind, array.shape)
    body.fill(found, array)
    return found


def _reshaped(_: _Body, array: ArrayView, shape: Several) -> ArrayView:
    sizes = _shape(shape)
    return ArrayView(array.kind, array.at, tuple(sizes), sizes[-1])


def _folded(body: _Body, array: ArrayView, start: Number, how: Callable[..., Number]) -> Number:
    found = body.slot(_LLVM[start.kind])
    body.do(f'store {_LLVM[start.kind]} {start.text}, ptr {found}')
    with body.counted('0', array.shape[0]) as i:
        x = body.load(array.kind, body.place(array, [Number('i', i)]).at)
        old = Number(start.kind, body.new(f'load {_LLVM[start.kind]}, ptr {found}'))
        body.do(f'store {_LLVM[start.kind]} {how(old, x).text}, ptr {found}')
    return Number(start.kind, body.new(f'load {_LLVM[start.kind]}, ptr {found}'))


def _any(body: _Body, array: ArrayView) -> Number:
    def either(old: Number, x: Number) -> Number:
        return Number('b', body.new(f'or i1 {old.text}, {body.cast(x, "b").text}'))

    return _folded(body, array, _ZERO['b'], either)


def _most(body: _Body, array: ArrayView) -> Number:
    first = body.load(array.kind, array.at)
    return _folded(body, array, first, lambda *x: _FUNCTIONS[max](body, *x))


_METHODS: dict[str, Callable[..., Any]] = {
    'copy': _copied, 'reshape': _reshaped, 'any': _any, 'max': _most,
}  # fmt: skip
