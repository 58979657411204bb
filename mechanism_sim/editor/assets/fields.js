import { html } from 'html';
import { words } from 'stage';

const same = (a, b) => a.length === b.length && a.every((x, i) => x === b[i]);

/** The parts of a scene, and the keys of the one that is chosen. */
export class Fields {
  /**
   * @param {HTMLElement} outline @param {HTMLFormElement} form
   * @param {function(Object): void} ask for changes
   */
  constructor(outline, form, ask) {
    Object.assign(this, { outline, form, ask });
    form.addEventListener('submit', (event) => event.preventDefault());
    // browsers take a field that is replaced for one that is left
    for (const left of ['change', 'blur']) form.addEventListener(left, (event) => this.making && event.stopPropagation(), true);
  }

  /** @param {Object} state as `Session.state` has it */
  show(state, colours) {
    this.#outline(state, colours);
    const own = this.#own;
    const [focused, from, to] = [own?.name, own?.selectionStart, own?.selectionEnd];
    const typed = this.typed ? own.value : null;
    const head = this.#head(state);
    const rows = state.rows.map((row) => this.#row(row, state));
    this.making = true;
    this.form.replaceChildren(...head, ...rows);
    this.making = false;
    const again = focused ? this.form.elements[focused] : null;
    if (!again) return;
    again.focus();
    if (again.tagName === 'SELECT') return;
    if (typed !== null && again.value !== typed) { // what somebody is typing stays, and is told when it is left
      again.value = typed;
      again.addEventListener('blur', () => again.dispatchEvent(new Event('change')));
    }
    again.setSelectionRange(from, to);
  }

  /** Whether something is typed that nobody was told. */
  get typed() {
    const own = this.#own;
    return Boolean(own) && own.tagName !== 'SELECT' && own.value !== own.defaultValue;
  }

  get #own() {
    return this.form.contains(document.activeElement) ? document.activeElement : null;
  }

  #outline({ outline, path, place }, colours) {
    const whole = html('button', { type: 'button', class: path.length ? '' : 'chosen' }, 'the whole scene');
    whole.addEventListener('click', () => this.ask({ type: 'select', path: [] }));
    this.outline.replaceChildren(whole, ...outline.map(({ name, parts }) => {
      const chips = parts.map((part) => {
        const wrong = place.length > 0 && part.every((x, i) => place[i] === x);
        const chip = html('button', { type: 'button', 'data-path': part.join('.'),
          class: `${same(part, path) ? 'chosen' : ''}${wrong ? ' wrong' : ''}` }, part.at(-1));
        if (name === 'links' && part[1] in colours) chip.style.setProperty('--link', `var(--link-${colours[part[1]]})`);
        chip.addEventListener('click', () => this.ask({ type: 'select', path: part }));
        return chip;
      });
      return html('div', { class: 'section' }, html('span', {}, words(name)), html('div', {}, ...chips));
    }));
  }

  /** The name of a part, and what can be done with all of it. */
  #head({ path, name, tracks }) {
    if (!path.length) return [html('h2', {}, name)];
    const last = path.at(-1);
    const title = html('input', { name: 'rename', value: last, class: 'name', spellcheck: 'false',
      'aria-label': `name of ${path.join('.')}` });
    title.disabled = path.length < 2 || last === 'ground';
    title.addEventListener('change', () => this.ask({ type: 'rename', path, name: title.value }));
    const away = html('button', { type: 'button', class: 'away', 'aria-label': `remove ${path.join('.')}` }, 'remove');
    away.addEventListener('click', () => this.ask({ type: 'remove', path }));
    const head = html('div', { class: 'head' }, title, ...(last === 'ground' ? [] : [away]));
    if (!tracks.length) return [head];
    const boxes = tracks.map(([point, on]) => {
      const box = html('input', { type: 'checkbox', 'data-track': point, ...(on ? { checked: '' } : {}) });
      box.addEventListener('change', () => this.ask({ type: 'trace', point }));
      return html('label', {}, box, ` ${point.split('.')[1]}`);
    });
    return [head, html('div', { class: 'tracks' }, 'paths of', ...boxes)];
  }

  #row(row, { place, problem, path }) {
    const key = row.path.join('.');
    const wrong = same(row.path, place)
      || (row.path.length === path.length + 1 && same(row.path, place.slice(0, row.path.length)) && row.kind !== 'part');
    const box = html('div', { class: `row ${row.kind}${wrong ? ' wrong' : ''}`, style: `--depth: ${row.depth}` });
    if (row.kind === 'absent') {
      const more = html('button', { type: 'button', title: row.help, 'data-add': key }, `+ ${words(row.name)}`);
      more.addEventListener('click', () => this.ask({ type: 'set', path: row.path, text: '{}' }));
      box.append(more);
      return box;
    }
    const id = `f-${key}`;
    box.append(html('label', { for: id }, words(row.name)));
    if (row.kind === 'part') {
      const away = html('button', { type: 'button', class: 'away', 'aria-label': `remove ${key}` }, 'remove');
      away.addEventListener('click', () => this.ask({ type: 'remove', path: row.path }));
      box.append(away);
    } else {
      box.append(this.#input(row, id, key));
    }
    const about = [row.help, row.unit && `[${row.unit}]`].filter(Boolean).join(' ');
    if (about) box.append(html('small', { id: `h-${key}` }, about));
    if (wrong) box.append(html('strong', { role: 'alert' }, problem));
    return box;
  }

  #input(row, id, key) {
    const given = { id, name: key, 'aria-describedby': `h-${key}` };
    let field;
    if (row.choices.length) {
      field = html('select', given, html('option', { value: '' }, row.default || '–'));
      field.append(...row.choices.map((x) => html('option', {}, x)));
      field.value = row.text;
    } else if (row.text.length > 40 || row.text.includes('\n')) {
      field = html('textarea', { ...given, rows: Math.min(6, Math.ceil(row.text.length / 36)), spellcheck: 'false' });
      field.defaultValue = row.text;
    } else {
      field = html('input', { ...given, placeholder: row.default, spellcheck: 'false' });
      field.defaultValue = row.text;
    }
    field.addEventListener('change', () => {
      if (field.value !== row.text) this.ask({ type: 'set', path: row.path, text: field.value });
    });
    return field;
  }
}
