/* What the theme leaves open for those who do not see the page, or have no mouse. */

document.addEventListener('DOMContentLoaded', () => {
  const all = (selector, act) => document.querySelectorAll(selector).forEach(act);
  all('[role=heading]:not([aria-level])', (x) => x.setAttribute('aria-level', '2'));
  all('.sidebar-drawer', (x) => x.setAttribute('aria-label', 'Pages'));
  all('.toc-drawer', (x) => x.setAttribute('aria-label', 'On this page'));
  all('th', (x) => { if (!x.innerText.trim()) x.setAttribute('role', 'presentation'); });
  all('th:has(math)', (x) => x.setAttribute('aria-label', x.textContent));
  const reach = () => all('pre, .table-wrapper, div.math, .math-wrapper, .output', (x) => {
    if (x.scrollWidth > x.clientWidth) x.tabIndex = 0;
    else x.removeAttribute('tabindex');
  });
  reach();
  window.addEventListener('resize', reach);
});
