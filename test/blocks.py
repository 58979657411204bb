"""Blocks of code in pages, how they are run, and what they print beside what the page shows.

- ``sh`` and ``python`` blocks are run, those of a page in their order and in one folder.
- ``console`` blocks hold commands after ``$`` and what each of them prints; a ``text`` block that
  follows a ``sh`` or ``python`` block directly holds what that one prints. A line ``...`` stands
  for any lines; numbers may differ in the last digit shown.
- A comment on the line before a block changes that: ``<!-- not run: REASON -->``, or
  ``<!-- numbers vary: REASON -->`` where only words can be compared.
- A block after ``<!-- file: NAME -->`` is written to that file, whatever its language.
- Blocks within a comment are run like others: what a page needs, but not its reader.
- Of tables whose last columns are ``command`` and ``answer`` each row is run: its command, in
  backticks and without ``mechanism-sim``, prints all that is in backticks in its answer.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import running
from running import ROOT

import mechanism_sim as ms

RUN = ('sh', 'python', 'console')
PROGRAMS = ('mechanism-sim', '-m mechanism_sim '), ('zros', '-m zenoh_rclpy '), ('python', '')
"""Programs that a shell of a page finds, and arguments of Python that start them."""
BLOCK = re.compile(
    r'(?:^ *<!-- (?P<mark>not run|numbers vary|file): (?P<reason>[^\n]+?) -->\n)?'
    r'^(?P<indent> *)```(?P<language>\S*)[^\n]*\n(?P<text>.*?)^(?P=indent)```$',
    re.DOTALL | re.MULTILINE,
)
TABLE = re.compile(
    r'^\|.*\| command \| answer \|\n\|[-|]+\|\n(?P<rows>(?:\|.*\|\n)+)', re.MULTILINE
)
NUMBER = re.compile(r'[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?')
BEFOREHAND = f"""
(while kill -0 {os.getpid()}; do sleep 0.5; done; kill -KILL -- -$$) < /dev/null &> /dev/null &
watching=$!
disown
trap 'kill $watching $(jobs -pr)' EXIT
"""
"""All that is started ends with this process, even if that is killed."""
AFTERWARDS = """
for _ in $(seq 30); do [ -z "$(jobs -pr)" ] && exit; sleep 0.1; done
kill $(jobs -pr) || true
wait || true
"""
"""What is still at work in the background has a moment to end by itself."""


@dataclass(frozen=True)
class Block:
    """A block of code in a page.

    Attributes
    ----------
    mark, reason : 'not run' or 'numbers vary' and why, or 'file' and its name; '' without
    shown : what the page shows as its output, if it does
    vary : whether only words of that can be compared
    """

    page: str
    line: int
    language: str
    text: str
    mark: str
    reason: str
    shown: str | None = None
    vary: bool = False

    @property
    def place(self) -> str:
        """As editors jump to it."""
        return f'{self.page}:{self.line}'


def pages() -> list[str]:
    """All pages with blocks, relative to the repository."""
    readmes = ROOT / 'README.md', ROOT / 'zenoh_rclpy' / 'README.md'
    files = [*readmes, *sorted((ROOT / 'docs').rglob('*.md'))]
    return [str(file.relative_to(ROOT)) for file in files if '```' in file.read_text('utf-8')]


def blocks(page: str) -> list[Block]:
    """Blocks of a page that are code, each with the output that follows it."""
    text = (ROOT / page).read_text(encoding='utf-8')
    found: list[Block] = []
    end = -1
    for match in BLOCK.finditer(text):
        content = re.sub(rf'^{match["indent"]}', '', match['text'], flags=re.MULTILINE)
        varies = match['mark'] == 'numbers vary'
        if match['language'] in RUN or match['mark'] == 'file':
            line = text.count('\n', 0, match.start('text'))
            mark, reason = match['mark'] or '', match['reason'] or ''
            found.append(Block(page, line, match['language'], content, mark, reason, vary=varies))
            end = match.end()
        elif match['language'] == 'text' and found and not text[end : match.start()].strip():
            found[-1] = Block(**{**vars(found[-1]), 'shown': content, 'vary': varies})
    return sorted([*found, *_rows(page, text)], key=lambda block: block.line)


def _rows(page: str, text: str) -> Iterator[Block]:
    """Rows of tables of commands and answers, those without a command left out."""
    for table in TABLE.finditer(text):
        first = text.count('\n', 0, table.start('rows')) + 1
        for line, row in enumerate(table['rows'].splitlines(), first):
            *_, command, answer = (cell.strip() for cell in row.strip('|').split(' | '))
            if command.startswith('`'):
                expected = '\n'.join(re.findall('`([^`]+)`', answer))
                yield Block(page, line, 'row', command.strip('`'), '', '', expected)


def commands(block: Block) -> Iterator[tuple[str, str | None]]:
    """Commands of a block of a shell, each with what it is said to print."""
    text = block.text.replace('\\\n', ' ')
    if block.language == 'console':
        for part in re.split(r'^\$ ', text, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition('\n')
            yield command, shown if shown.strip() else None
    else:
        for line in text.splitlines():
            if line.strip() and not line.lstrip().startswith('#'):
                yield line, None


def words(command: str) -> list[str] | None:
    """Arguments of a command of ours; nothing if it takes a shell to run it."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    found = list(lexer)
    plain = not any(set(word) <= set('();<>|&') for word in found) and '$' not in command
    return found[1:] if plain and found[0] == 'mechanism-sim' else None


def _split(line: str) -> tuple[list[str] | None, str]:
    """Arguments of a command of ours, and what its output is piped into."""
    command, _, filtered = line.partition(' | ')
    return words(command), filtered


def new_scene(page: str, name: str, *changes: str) -> ms.Machine:
    """A scene that a page makes by `new NAME --from SCENE --set ...`, changed."""
    (line,) = re.findall(rf'^mechanism-sim new {name} .*$', page, re.MULTILINE)
    words = shlex.split(line)
    changed = {change.partition('=')[0] for change in changes}
    own = [words[i + 1] for i, word in enumerate(words) if word == '--set']
    own = [x for x in own if x.partition('=')[0] not in changed]  # one path, one value
    return ms.load_scene(words[words.index('--from') + 1], [*own, *changes])


def run(block: Block, names: dict[str, Any]) -> None:
    """Run a block in the current folder, and compare what it prints with what the page shows.

    Parameters
    ----------
    names : of the page's Python so far
    """
    if block.mark == 'file':
        Path(block.reason).write_text(block.text, encoding='utf-8')
        return
    if block.language == 'row':
        _check_row(block)
        return
    if block.language == 'python':
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(block.text, block.place, 'exec', dont_inherit=True), names)
        printed = out.getvalue()
    elif block.language == 'console' or all(_split(line)[0] for line, _ in commands(block)):
        printed = ''
        for command, shown in commands(block):
            done = _command(command)
            printed += done.stdout
            if shown is None:
                assert done.returncode == 0, f'{block.place}: {command}\n{done.stderr}'
            else:
                compare(shown, done.stdout + done.stderr, block.vary, f'{block.place}: {command}')
    else:
        done = _shell(block.text)
        assert done.returncode == 0, f'{block.place}\n{done.stdout}\n{done.stderr}'
        printed = done.stdout
    if block.shown is not None:
        compare(block.shown, printed, block.vary, block.place)


def _check_row(block: Block) -> None:
    """Run the command of a row of a table; each part of its answer is in a line that it prints."""
    done = _command(f'mechanism-sim {block.text}')
    printed = done.stdout + done.stderr
    lines = [line.split() for line in printed.splitlines()]
    assert block.shown, f'{block.place}: the answer has nothing that the command prints'
    for part in block.shown.splitlines():
        size = len(part.split())
        windows = (' '.join(w[k : k + size]) for w in lines for k in range(len(w) - size + 1))
        assert any(_same_line(part, window.rstrip(',:;'), False) for window in windows), (
            f'{block.place}: {block.text} does not print\n{part}\nbut\n{printed}'
        )


def _command(command: str) -> subprocess.CompletedProcess[str]:
    """In this process where that makes no difference."""
    args, filtered = _split(command)
    if args is None:
        return _shell(command)
    done = running.run(*args, env=dict(os.environ) if running.goes_apart(args) else None)
    return _shell(filtered, done.stdout) if filtered and done.returncode == 0 else done


def _shell(text: str, given: str = '') -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-euo', 'pipefail', '-c', f'{BEFOREHAND}\n{text}\n{AFTERWARDS}'],
        input=given,
        capture_output=True,
        text=True,
        timeout=running.TIMEOUT,
        check=False,
        start_new_session=True,
    )


def workplace(folder: Path) -> dict[str, str]:
    """Make a folder look like that of the repository, and give an environment to work in it."""
    (folder / 'docs').mkdir()
    for file in (ROOT / 'docs').glob('*.py'):
        (folder / 'docs' / file.name).symlink_to(file)
    for name in ('config', 'msg', 'docs/books'):
        (folder / name).symlink_to(ROOT / name)
    programs = folder / '.bin'
    programs.mkdir()
    for name, start in PROGRAMS:
        program = programs / name
        program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} {start}"$@"\n', 'utf-8')
        program.chmod(0o755)
    path = f'{programs}{os.pathsep}{os.environ["PATH"]}'
    return {**running.environment(), 'ROS_DOMAIN_ID': '0', 'PATH': path}


def compare(shown: str, printed: str, vary: bool, place: str) -> None:
    """Compare output with what a page shows of it.

    Raises
    ------
    AssertionError
        That says which lines are not there.
    """
    lines = [line.rstrip() for line in printed.splitlines()]
    at = 0
    parts = [part.split('\n') for part in re.split(r'^ *\.\.\.$\n?', shown, flags=re.MULTILINE)]
    parts = [[line for line in part if line.strip()] for part in parts]
    lines = [line for line in lines if line.strip()]
    for k, part in enumerate(parts):
        starts = [at] if k == 0 else range(at, len(lines) - len(part) + 1)
        if k and k == len(parts) - 1 and part:
            starts = [len(lines) - len(part)]
        begin = next((s for s in starts if _same(part, lines[s : s + len(part)], vary)), None)
        if begin is None or (len(parts) == 1 and len(lines) != len(part)):
            new = [line for line in part if not any(_same_line(line, p, vary) for p in lines)]
            missing = '\n'.join(new or part)
            raise AssertionError(f'{place} does not print\n{missing}\nbut\n{printed}')
        at = begin + len(part)


def _same(shown: list[str], printed: list[str], vary: bool) -> bool:
    return len(shown) == len(printed) and all(
        _same_line(*pair, vary) for pair in zip(shown, printed, strict=True)
    )


def _same_line(shown: str, printed: str, vary: bool) -> bool:
    texts = [' '.join(NUMBER.sub('#', line).split()) for line in (shown, printed)]
    if vary:
        texts = [text.replace('- #', '#') for text in texts]
    if texts[0] != texts[1]:
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    return vary or all(_close(*pair) for pair in pairs)


def _close(shown: str, printed: str) -> bool:
    """True if two numbers differ by at most one in the last digit shown of either."""
    digits = [_last_digit(text) for text in (shown, printed)]
    return abs(float(shown) - float(printed)) <= 1.01 * max(digits)


def _last_digit(text: str) -> float:
    mantissa, _, exponent = text.partition('e')
    decimals = len(mantissa.partition('.')[2])
    if decimals == 0 and not exponent:
        return 0.0  # a count is exact
    return float(10.0 ** (int(exponent or 0) - decimals))
