/**
 * Calls what keys do. What has the focus by the keyboard keeps its own keys; what was clicked on
 * gives the focus back, so that the space bar plays and pauses after it.
 * @param {Object<string, function(): void>} acts by the names of keys
 */
export function keys(acts) {
  document.addEventListener('keydown', (event) => {
    const { key, target, repeat, ctrlKey, altKey, metaKey } = event;
    if (!(key in acts) || ctrlKey || altKey || metaKey) return;
    const own = key === ' ' ? 'button, select, a, input:not([type=range])'
      : key === 'Escape' ? 'select' : 'select, input[type=range]';
    if (target.closest?.(own)) return;
    event.preventDefault();
    if (!(repeat && key === ' ')) acts[key]();
  });
  const give = ({ target, detail }) => {
    if (detail && target.closest?.('button, input[type=checkbox], label')) document.activeElement.blur();
  };
  document.addEventListener('click', give);
  document.addEventListener('change', ({ target }) => { if (target.matches('select')) target.blur(); });
}
