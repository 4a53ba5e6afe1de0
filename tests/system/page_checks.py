"""What is wrong with a page for those who cannot see it as its makers do: our own checks, and those of axe-core."""

import os

AXE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "axe", "node_modules", "axe-core", "axe.min.js")
AXE_MISSING = "axe-core is not installed (npm ci --prefix tests/system/axe): only our own checks of accessibility were made"
# What a page must not have: [overflow, controls without a name, pictures without one, headings missing, low contrast].
CHECKS = """(() => {
  const visible = element => element.getClientRects().length > 0 && getComputedStyle(element).visibility !== 'hidden';
  const named = element => (element.getAttribute('aria-label') || element.textContent || '').trim() ||
    (element.labels && element.labels.length > 0) || element.getAttribute('aria-labelledby');
  const wrong = [];
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  if (wide > 0) wrong.push(wide + ' pixels wider than the screen');
  for (const element of document.querySelectorAll('a, button, input, select, summary, canvas, progress, svg[role=img]')) {
    if (!element.closest('dialog:not([open])') && !named(element)) wrong.push('has no name: ' + element.outerHTML.slice(0, 120));
  }
  for (const element of document.querySelectorAll('table')) {
    if (!element.caption || !element.caption.textContent.trim()) wrong.push('a table without a caption');
  }
  const ids = [...document.querySelectorAll('[id]')].map(element => element.id);
  for (const id of ids.filter((id, i) => ids.indexOf(id) !== i)) wrong.push('an id twice: ' + id);
  for (const element of document.querySelectorAll('[aria-labelledby]')) {
    if (!document.getElementById(element.getAttribute('aria-labelledby'))) wrong.push('labelled by nothing: ' + element.tagName);
  }
  if (document.querySelectorAll('h1').length !== 1) wrong.push(document.querySelectorAll('h1').length + ' main headings');
  const levels = [...document.querySelectorAll('main h1, main h2, main h3')].map(heading => Number(heading.tagName[1]));
  levels.forEach((level, i) => { if (i > 0 && level > levels[i - 1] + 1) wrong.push('a level of headings is left out'); });
  const numbers = color => color.match(/[0-9.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map(v => v / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = element => {
    for (let at = element; at; at = at.parentElement) {
      const color = numbers(getComputedStyle(at).backgroundColor);
      if (color.length < 4 || color[3] > 0) return color;
    }
    return [255, 255, 255];
  };
  const seen = new Set();
  for (const element of document.querySelectorAll('body *')) {
    const text = [...element.childNodes].some(node => node.nodeType === 3 && node.data.trim());
    if (!text || !visible(element) || element.closest('.unseen, dialog:not([open]), svg, noscript')) continue;
    const a = light(numbers(getComputedStyle(element).color)), b = light(ground(element));
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const what = element.tagName + '.' + element.className;
    if (contrast < 4.5 && !seen.has(what)) wrong.push('contrast of ' + contrast.toFixed(2) + ': ' + what);
    if (contrast < 4.5) seen.add(what);
  }
  return wrong;
})()"""


RUN_AXE = """axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa'], resultTypes: ['violations']}).then(found =>
  found.violations.map(one => 'axe: ' + one.id + ' (' + one.help + '): ' + one.nodes.slice(0, 3).map(node => node.html.slice(0, 120)).join(' | ')))"""


def has_axe():
    return os.path.isfile(AXE)


def faults_of(page):
    """All that is wrong with what a page shows now, as sentences: WCAG 2.1 A and AA as far as axe-core sees it."""
    wrong = page.value(CHECKS)
    if has_axe():
        if not page.value("typeof axe === 'object'"):
            with open(AXE, encoding="utf-8") as file:
                page.value(file.read() + "; true")
        wrong += page.value(RUN_AXE)
    return wrong
