/** Charts as files: made in the page and saved by the browser, so that nothing leaves the machine. */

/** Saves a file. @param {Blob} blob @param {string} name with its ending */
export function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name.replace(/[^\w.-]+/g, '_');
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/**
 * Columns as comma-separated values, those that are shorter with empty cells below.
 * @param {[string, ArrayLike<number|string>][]} columns headings and values
 */
export function table(columns) {
  const count = columns.reduce((most, [, values]) => Math.max(most, values.length), 0);
  const lines = [columns.map(([heading]) => cell(heading))];
  for (let i = 0; i < count; i += 1) lines.push(columns.map(([, values]) => cell(values[i])));
  return new Blob([lines.map((line) => `${line.join(',')}\r\n`).join('')], { type: 'text/csv' });
}

function cell(value) {
  if (typeof value === 'number') return Number.isFinite(value) ? String(value) : '';
  // a text that a spreadsheet would take as a formula is marked as text
  const text = String(value ?? '').replace(/^[=+\-@\t\r]/, "'$&");
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
