// Elements and figures. What comes from outside goes into text nodes and attributes only, never into markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" && "value" in element) element.value = value;
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.flat().filter(child => child !== null && child !== undefined && child !== false && child !== ""));
  return element;
}

export function h(tag, attributes, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

export function replace(element, ...children) {
  element.replaceChildren(...children.flat().filter(child => child));
}

// Puts new content into a live part of a page without taking the focus from a control that is in both.
export function refresh(element, ...children) {
  const held = element.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
  replace(element, ...children);
  if (held) {
    const again = [...element.querySelectorAll("[data-key]")].find(control => control.dataset.key === held);
    if (again) again.focus({preventScroll: true});
  }
}

// Says something to those who listen to the page instead of looking at it.
let spoken = 0;
export function announce(text) {
  const live = document.getElementById("live");
  const mine = ++spoken;
  live.textContent = "";
  requestAnimationFrame(() => { if (mine === spoken) live.textContent = text; });
}

export function bytes(count) {
  if (!Number.isFinite(count)) return "–";
  if (count < 1000) return `${count} B`;
  if (count < 1e6) return `${(count / 1e3).toFixed(1)} kB`;
  if (count < 1e9) return `${(count / 1e6).toFixed(count < 1e7 ? 2 : 1)} MB`;
  return `${(count / 1e9).toFixed(2)} GB`;
}

export function duration(seconds) {
  if (!Number.isFinite(seconds) || seconds < 0) return "–";
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const whole = Math.round(seconds);
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  if (whole < 86400) return `${Math.floor(whole / 3600)} h ${Math.floor(whole % 3600 / 60)} min`;
  return `${Math.floor(whole / 86400)} d ${Math.floor(whole % 86400 / 3600)} h`;
}

export function decibels(value) {
  return Number.isFinite(value) ? `${value.toFixed(2)} dB` : "–";
}

export function count(value) {
  return Number(value || 0).toLocaleString("en");
}

// A moment as people say it, with the moment itself for those who ask.
export function moment(text) {
  const time = new Date(text);
  if (Number.isNaN(time.getTime())) return h("span", {}, "–");
  const seconds = (Date.now() - time.getTime()) / 1000;
  const said = seconds < -1 ? `in ${duration(-seconds)}` : seconds < 60 ? "just now"
    : seconds < 3600 ? `${Math.floor(seconds / 60)} min ago`
    : seconds < 86400 ? `${Math.floor(seconds / 3600)} h ago` : time.toLocaleDateString("en-CA");
  return h("time", {datetime: text, title: time.toLocaleString("en-CA")}, said);
}

export function facts(entries) {
  return h("dl", {class: "facts"}, entries.map(([name, ...value]) => h("div", {}, h("dt", {}, name), h("dd", {}, ...value))));
}

// A table that scrolls by itself where it is too wide. head: names; rows: lists of cells, the first of which names the row.
export function table(caption, head, rows, kind) {
  return h("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": caption},
    h("table", {class: kind || "words"}, h("caption", {}, caption),
      h("thead", {}, h("tr", {}, head.map(name => h("th", {scope: "col"}, name)))),
      h("tbody", {}, rows.map(([first, ...cells]) =>
        h("tr", {}, h("th", {scope: "row"}, first), cells.map(cell => h("td", {}, cell)))))));
}

// The first line of a message, files without the folders they lie in.
export function brief(text) {
  return text.split("\n")[0].replace(/(^|\s)\/(?:[^\s/:]+\/)+/g, "$1").slice(0, 160);
}

const STATES = {
  queued: "Waiting", running: "Running", succeeded: "Done", failed: "Failed", cancelled: "Cancelled",
  retry_waiting: "Waits to retry", buried: "Given up", pending: "Settling", baked: "Baked", gone: "Source gone"
};
export function stateName(state) {
  return STATES[state] || String(state);
}
export function stateMark(state) {
  const known = Object.hasOwn(STATES, state) ? state : "unknown";
  return h("span", {class: `state is-${known}`}, stateName(state));
}

export function isFinal(state) {
  return ["succeeded", "failed", "cancelled", "buried"].includes(state);
}

// "Training, 31.20 dB, +0.40 dB in 10 s, 12 s left"
export function progressText(progress) {
  if (!progress) return "starts";
  const parts = [progress.stage || "starts"];
  if (progress.psnr_db > 0) parts.push(decibels(progress.psnr_db));
  if (progress.gain_10s_db > 0) parts.push(`+${progress.gain_10s_db.toFixed(2)} dB in 10 s`);
  if (progress.eta_s >= 0) parts.push(`${duration(progress.eta_s)} left`);
  return parts.join(", ");
}

export function progressBar(progress, label) {
  const bar = h("progress", {max: "1", "aria-label": label});
  if (progress && progress.fraction >= 0) bar.value = progress.fraction;
  return bar;
}

export function failure(error) {
  return h("p", {class: "problem", role: "alert"}, error.message || String(error));
}
