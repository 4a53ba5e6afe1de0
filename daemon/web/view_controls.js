// The controls of the viewer: each is bound to one member of the state, and told when that changes otherwise.
import {h} from "./dom.js";

export class Controls {
  // changed(name): after a control has changed state[name].
  constructor(state, changed) {
    this.state = state;
    this.changed = changed;
    this.shows = [];
  }

  // Shows the state as it is.
  refresh() {
    for (const show of this.shows) show();
  }

  group(legend, ...children) {
    return h("fieldset", {}, h("legend", {}, legend), ...children);
  }

  // options: [value, label, is disabled].
  choices(name, label, options) {
    const inputs = options.map(([value, , disabled]) => {
      const input = h("input", {type: "radio", name, value, disabled: Boolean(disabled)});
      input.addEventListener("change", () => { this.set(name, value); });
      return input;
    });
    this.shows.push(() => inputs.forEach(input => { input.checked = input.value === this.state[name]; }));
    return h("div", {class: "choices", role: "radiogroup", "aria-label": label},
      options.map(([, text], i) => h("label", {}, inputs[i], h("span", {}, text))));
  }

  // groups: [label, [[value, text] ...]].
  select(name, label, groups) {
    const select = h("select", {id: `pick-${name}`, "aria-label": label}, groups.map(([head, options]) =>
      h("optgroup", {label: head}, options.map(([value, text]) => h("option", {value}, text)))));
    select.addEventListener("change", () => { this.set(name, select.value); });
    this.shows.push(() => { select.value = this.state[name]; });
    return select;
  }

  // say(value): the value for people. A curve, {to, from}, maps the control's own scale to the value and back.
  slider(name, label, least, most, step, say, curve = {to: value => value, from: value => value}) {
    const input = h("input", {type: "range", min: least, max: most, step, id: `slide-${name}`, name});
    const output = h("output", {for: `slide-${name}`});
    input.addEventListener("input", () => { this.set(name, curve.to(Number(input.value))); });
    this.shows.push(() => {
      input.value = curve.from(this.state[name]);
      output.textContent = say(this.state[name]);
      input.setAttribute("aria-valuetext", say(this.state[name]));
    });
    return h("div", {class: "slide"}, h("label", {for: `slide-${name}`}, label), output, input);
  }

  tick(name, label) {
    const input = h("input", {type: "checkbox", name});
    input.addEventListener("change", () => { this.set(name, input.checked); });
    this.shows.push(() => { input.checked = this.state[name]; });
    return h("label", {class: "tick"}, input, label);
  }

  set(name, value) {
    this.state[name] = value;
    this.refresh();
    this.changed(name);
  }
}
