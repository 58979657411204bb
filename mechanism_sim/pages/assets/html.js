/**
 * An HTML element. Texts within are texts: nothing in them is read as HTML.
 * @param {string} name
 * @param {Object<string, string|number>} attributes
 * @param {...(Node|string)} inner
 * @returns {HTMLElement}
 */
export function html(name, attributes = {}, ...inner) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inner);
  return made;
}
