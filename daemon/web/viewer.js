// The viewer: one container on the graphics card, decoded by the shader that engines use.
import {keepToken, onTokenWanted, part} from "./api.js";
import {announce, bytes, decibels, facts, failure, h, replace, table} from "./dom.js";
import {askForToken} from "./token.js";
import {loadContainer, mapsOf, ONE_CONTAINER} from "./view_container.js";
import {Controls} from "./view_controls.js";
import {listen} from "./view_pointer.js";
import {Scene, sizeOf} from "./view_scene.js";

// Of one frame while something is dragged, and of one that stays: what takes longer is drawn smaller.
const SMOOTH_MS = 40, PATIENT_MS = 600, LEAST_SCALE = 0.2;
const WEIGHED_SIDE = 64;
const MOST_SIDE = 1600;
const MEASURED_FRAMES = 8;

const START = {
  shape: "sphere", show: "lit", compare: "decoded", wipe: 0.5, gain: 8, exposure: 0, light: 2, studio: 1, lightX: -0.45, lightY: 0.5,
  yaw: 0, pitch: 0, zoom: 1, panX: 0, panY: 0, repeat: 1, mip: -1, smooth: true, full: false, drag: "light", theta: 45, phi: 0, logarithmic: false,
  u: 0.5, v: 0.5, level: 0, incoming: 30, outgoing: -30
};
const element = id => document.getElementById(id);
const canvas = element("view");
const state = {...START};
let scene = null, container = null, controls = null;
let perPixelMs = 0, isMoving = false, isWaiting = false, isLost = false;

// ---- drawing

function fit() {
  const box = element("frame").getBoundingClientRect();
  const full = Math.min(devicePixelRatio || 1, MOST_SIDE / Math.max(box.width, box.height));
  // A lobe is a mere surface once it is made.
  const cost = state.full || state.shape === "lobe" ? 0 : perPixelMs * box.width * box.height * full * full;
  const ratio = full * Math.min(1, Math.max(LEAST_SCALE, Math.sqrt((isMoving ? SMOOTH_MS : PATIENT_MS) / Math.max(cost, 1e-6))));
  const [width, height] = [box.width, box.height].map(side => Math.max(1, Math.round(side * ratio)));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
}

function draw() {
  if (isWaiting || !scene || isLost) return;
  isWaiting = true;
  requestAnimationFrame(() => {
    isWaiting = false;
    if (isLost) return;
    fit();
    scene.draw(state);
  });
}

// What a frame costs here decides how large it is drawn.
function weigh() {
  canvas.width = canvas.height = WEIGHED_SIDE;
  perPixelMs = scene.measure(state, 1) / (WEIGHED_SIDE * WEIGHED_SIDE);
}

function measureCost() {
  const [width, height] = [canvas.width, canvas.height];
  // Of a size that can be compared, whatever the window is.
  canvas.width = canvas.height = 512;
  const ms = scene.measure(state, MEASURED_FRAMES);
  [canvas.width, canvas.height] = [width, height];
  draw();
  const said = `${ms.toFixed(ms < 10 ? 2 : 1)} ms a frame of 512 × 512, ${Math.round(1000 / ms)} a second`;
  replace(element("cost"), h("b", {}, `${ms.toFixed(ms < 10 ? 2 : 1)} ms`), ` a frame of 512 × 512, ${Math.round(1000 / ms)} a second`);
  element("cost").dataset.ms = String(ms);
  announce(said);
}

// ---- what changes with the state

function showLines() {
  const isWipe = state.compare === "wipe" && state.shape !== "lobe";
  element("wipe-row").hidden = element("rule").hidden = !isWipe;
  element("left").hidden = !isWipe;
  element("right").hidden = state.compare === "decoded" || state.shape === "lobe";
  element("right").textContent = state.compare === "wipe" ? "decoded" : state.compare;
  // The style of an element, set from here, is no inline style of the page.
  element("rule").style.left = `${100 * state.wipe}%`;
  element("wipe").value = state.wipe;
  const names = {lit: "lit", ...Object.fromEntries(showOptions().flatMap(([, options]) => options))};
  const shown = state.shape === "lobe" ? `lobe of light from ${state.theta} degrees` : names[state.show];
  canvas.setAttribute("aria-label", `${container.manifest.asset} on a ${state.shape}: ${shown}, ${state.compare}`);
}

function changed(name) {
  if (["theta", "phi", "logarithmic", "shape", "u", "v", "level"].includes(name) && state.shape === "lobe") {
    const most = scene.makeLobe(state.theta, state.phi, state.logarithmic, [state.u, state.v, state.level]);
    element("under").textContent = `Light from ${state.theta}° scattered to all directions: f cos θ, at most ${most.toPrecision(3)} /sr. ` +
      "Colours are those of f; drag turns it.";
  } else if (name === "shape") {
    element("under").textContent = noteOf();
  }
  if (name === "shape") {
    if (state.shape === "plane") Object.assign(state, {yaw: 0, pitch: 0});
    for (const one of document.querySelectorAll("[data-for]")) one.hidden = (one.dataset.for === "lobe") !== (state.shape === "lobe");
    if (state.shape === "lobe") Object.assign(state, {yaw: 0.5, pitch: 0.35, drag: "turn"});
    controls.refresh();
  }
  if (["u", "v", "level", "incoming", "outgoing"].includes(name)) showValues();
  showLines();
  draw();
}

function reset() {
  const {shape, show, compare, u, v, level, incoming, outgoing} = state;
  Object.assign(state, START, {shape, show, compare, u, v, level, incoming, outgoing});
  controls.refresh();
  changed("shape");
  announce("All is set back");
}

// ---- what there is to be seen

function showOptions() {
  if (scene.kind !== "material") return [];
  const {manifest} = container;
  const maps = mapsOf(manifest);
  const has = value => scene.names.includes(value);
  const whole = maps.filter(map => has(`map:${map.map}`)).map(map => [`map:${map.map}`, map.map.replaceAll("_", " ")]);
  const single = maps.filter(map => map.channels.length > 1).flatMap(map => map.channels.map(i =>
    [`channel:${i}`, `${map.map.replaceAll("_", " ")} ${manifest.channels[i].component}`]));
  return [["Material", [["lit", "Lit"]]], ["Maps", whole], ...(single.length > 0 ? [["Single channels", single]] : [])];
}

// Said under the picture: what is not as it seems.
function noteOf() {
  const {manifest, source} = container;
  const notes = [];
  if (scene.inPage) notes.push(`Textures are decoded by this page, to the same numbers: ${scene.inPage}.`);
  if (scene.kind !== "material") notes.push("Lit by the light and the middles of three lamps.");
  else {
    const shaded = ["albedo", "normal", "roughness", "metalness", "ao", "emissive", "opacity", "clearcoat", "clearcoat_roughness"];
    const others = mapsOf(manifest).map(map => map.map).filter(map => !shaded.includes(map));
    if (others.length > 0) notes.push(`Not shaded, to be seen as maps: ${others.join(", ").replaceAll("_", " ")}.`);
    if (source && !source.same_source) notes.push("The source's files are not those that this was baked from.");
    const without = source ? manifest.channels.filter((channel, i) => !source.channels[i]).map(channel => channel.map) : [];
    if (without.length > 0) notes.push(`The source has no ${[...new Set(without)].join(", ")}.`);
  }
  return notes.join(" ");
}

function showValues() {
  const target = element("values");
  if (!scene.canProbe) {
    replace(target, h("p", {class: "quiet"}, "This browser cannot render to floats (EXT_color_buffer_float), so it reads no values back."));
    return;
  }
  const say = value => Number(value.toPrecision(6)).toString();
  if (scene.kind !== "material") {
    const direction = degrees => [Math.sin(degrees * Math.PI / 180), 0, Math.cos(degrees * Math.PI / 180)];
    const f = scene.brdfAt(direction(state.incoming), direction(state.outgoing), [state.u, state.v, state.level]);
    replace(target, table("f in 1/sr", ["", "value"], ["red", "green", "blue"].map((name, i) => [name, h("data", {value: String(f[i])}, say(f[i]))]), "numbers"));
    return;
  }
  const decoded = scene.valuesAt(state.u, state.v, state.level, false);
  const source = container.source && scene.valuesAt(state.u, state.v, state.level, true);
  const head = ["channel", "decoded", ...(source ? ["source"] : [])];
  replace(target, table("Physical values", head, container.manifest.channels.map((channel, i) => {
    const cells = [decoded[i], ...(source ? [container.source.channels[i] ? source[i] : NaN] : [])];
    return [`${channel.map.replaceAll("_", " ")} ${channel.component}`,
      ...cells.map(value => Number.isNaN(value) ? "–" : h("data", {value: String(value)}, say(value)))];
  }), "numbers"));
}

function numberField(name, label, least, most, step) {
  const input = h("input", {type: "number", min: least, max: most, step, id: `at-${name}`, value: state[name]});
  input.addEventListener("change", () => {
    const value = Number(input.value);
    if (!Number.isFinite(value)) return;
    state[name] = Math.min(Math.max(value, least), most);
    input.value = state[name];
    changed(name);
  });
  return h("label", {for: `at-${name}`}, label, input);
}

function buildPanel() {
  controls = new Controls(state, changed);
  const c = controls;
  const isBrdf = scene.kind !== "material", isPlaced = scene.kind !== "brdf";
  const {manifest, bindings, source} = container;
  const lobes = scene.canProbe ? [["lobe", "Lobe"]] : [];
  const ev = value => `${value > 0 ? "+" : ""}${value.toFixed(1)} EV`;
  const times = value => `× ${value < 10 ? value.toFixed(2) : value.toFixed(0)}`;
  const logarithm = {to: value => 2 ** value, from: value => Math.log2(value)};
  const {levels} = sizeOf(container);
  const whole = isBrdf ? [] : [
    c.group("Show", c.select("show", "What is shown", showOptions())),
    c.group("Compare", c.choices("compare", "Compare", [["decoded", "Decoded"], ["source", "Source", !source], ["wipe", "Wipe", !source],
      ["difference", "Difference", !source]]),
    source ? c.slider("gain", "Gain of the difference", 0, 8, 0.5, times, logarithm)
      : h("p", {class: "quiet"}, "The source is not here. ", h("code", {}, "patina view CONTAINER --source FOLDER"),
        " puts the maps it was baked from beside it, filtered as they were for the bake."))];
  const sampling = !isPlaced ? [] : [
    bindings.address === "clamp" ? false : c.slider("repeat", "Repeated", 1, 8, 1, value => `${value} ×`),
    c.slider("mip", "Mip", -1, levels - 1, 1, value => value < 0 ? "as the screen calls for" : String(value)),
    c.tick("smooth", "Filter textures (off: the texels of the features)")];
  const angles = h("div", {class: "fields"}, numberField("incoming", "light, °", -89, 89, 1), numberField("outgoing", "view, °", -89, 89, 1));
  const place = h("div", {class: "fields"}, numberField("u", "u", -16, 16, "any"), numberField("v", "v", -16, 16, "any"),
    numberField("level", "mip", 0, 20, "any"));
  const values = [isBrdf && angles, isPlaced && place];
  replace(element("panel"),
    c.group("Shape", c.choices("shape", "Shape", [["plane", "Plane"], ["sphere", "Sphere"], ["cube", "Cube"], ...(isBrdf ? lobes : [])]),
      isBrdf && h("div", {"data-for": "lobe", hidden: true}, c.slider("theta", "Angle of the light", 0, 88, 1, value => `${value}°`),
        !manifest.brdf.isotropic && c.slider("phi", "Azimuth of the light", 0, 360, 1, value => `${value}°`),
        c.tick("logarithmic", "Logarithmic, for what is faint"))),
    ...whole,
    h("div", {"data-for": "surface"}, c.group("Light", c.slider("exposure", "Exposure", -4, 4, 0.1, ev), c.slider("light", "Light", 0, 8, 0.1, times),
      c.slider("studio", "Studio around it", 0, 2, 0.05, times), c.slider("lightX", "Light, left to right", -1, 1, 0.02, value => value.toFixed(2)),
      c.slider("lightY", "Light, down to up", -1, 1, 0.02, value => value.toFixed(2)))),
    c.group("View", c.choices("drag", "Drag", [["light", "Drag: light"], ["turn", "turn"], ["pan", "move"]]),
      c.slider("zoom", "Zoom", -2, 8.6, 0.1, times, logarithm), c.slider("yaw", "Turned", -3.2, 3.2, 0.05, value => `${Math.round(value * 180 / Math.PI)}°`),
      c.slider("pitch", "Tilted", -1.57, 1.57, 0.05, value => `${Math.round(value * 180 / Math.PI)}°`), ...sampling,
      c.tick("full", "Every pixel, however long it takes"),
      h("p", {class: "actions"}, h("button", {type: "button", id: "reset", onclick: reset}, "Set all back"))),
    c.group("Cost", h("p", {class: "cost", id: "cost"}, "Not measured yet."),
      h("p", {class: "actions"}, h("button", {type: "button", id: "measure", onclick: measureCost}, "Measure a frame"))),
    h("fieldset", {}, h("legend", {}, isBrdf ? "Values in the plane of incidence" : "Values at a place"), ...values, h("div", {id: "values"})));
  element("panel").addEventListener("submit", event => event.preventDefault());
  controls.refresh();
}

function showFacts() {
  const {manifest} = container;
  const engine = manifest.payloads.filter(payload => !["preview", "report"].includes(payload.role)).reduce((sum, payload) => sum + payload.bytes, 0);
  const quality = manifest.quality || {};
  const cells = [["for an engine", bytes(engine)]];
  if (quality.psnr_db) cells.push(["PSNR of mip 0", decibels(quality.psnr_db.mip0 ?? Infinity)]);
  if (Number.isFinite(quality.ssim)) cells.push(["SSIM", quality.ssim.toFixed(4)]);
  if (Number.isFinite(quality.image_ssim)) cells.push(["SSIM of the sphere", quality.image_ssim.toFixed(4)]);
  if (manifest.kind === "material") {
    cells.push(["texels", `${manifest.source.width} × ${manifest.source.height}`], ["channels", String(manifest.channels.length)]);
    if (manifest.network) cells.push(["network", `${manifest.network.inputs} → ${manifest.network.hidden} → ${manifest.network.outputs}`]);
    cells.push(["profile", manifest.profile]);
  } else {
    if (manifest.kind === "svbrdf") cells.push(["texels", `${sizeOf(container).width} × ${sizeOf(container).height}`]);
    cells.push(["network", manifest.brdf.network.layers.join(" → ")], ["Nside", String(manifest.brdf.nside)], ["source", manifest.source.format]);
  }
  replace(element("facts"), facts(cells));
  element("facts-section").hidden = false;
}

async function showPreview() {
  if (!container.preview) return;
  const image = await createImageBitmap(container.preview);
  const drawn = h("canvas", {role: "img", "aria-label": "Source, decoded and difference of each map", width: image.width, height: image.height});
  drawn.getContext("2d").drawImage(image, 0, 0);
  replace(element("preview"), drawn);
  element("preview-section").hidden = false;
}

// ---- begin

function say(text, className) {
  element("status").textContent = text;
  element("status").className = `link ${className || ""}`;
}

function complain(error) {
  say("Failed", "down");
  replace(element("trouble"), failure(error));
}

canvas.addEventListener("webglcontextlost", event => {
  event.preventDefault();
  isLost = true;
  say("Waiting for the graphics card", "down");
  replace(element("trouble"), failure(new Error("The graphics driver has taken the picture away, as it does when it restarts or runs out of memory. " +
    "It comes back by itself; if it does not, close other pages that draw, and load this one again.")));
});
canvas.addEventListener("webglcontextrestored", () => {
  try {
    scene.begin();
    isLost = false;
    replace(element("trouble"));
    say("Ready", "up");
    changed("shape");
  } catch (error) {
    complain(error);
  }
});

function start() {
  scene = new Scene(canvas, container);
  element("desk").hidden = false;
  buildPanel();
  element("under").textContent = noteOf();
  listen(canvas, state, {
    changed(what) {
      if (what === "wipe") showLines();
      else if (what !== "pan") controls.refresh();
      draw();
    },
    moving(is) {
      isMoving = is;
      draw();
    },
    reset
  });
  element("wipe").addEventListener("input", event => {
    state.wipe = Number(event.target.value);
    showLines();
    draw();
  });
  new ResizeObserver(draw).observe(element("frame"));
  weigh();
  if (scene.kind === "material" || scene.canProbe) showValues();
  showLines();
  draw();
}

async function begin() {
  onTokenWanted(askForToken);
  const token = /^#token=([A-Za-z0-9]+)$/.exec(location.hash);
  if (token) {
    keepToken(token[1]);
    // Not to stand on the screen for everybody to read.
    history.replaceState(null, "", location.pathname + location.search);
  }
  const query = new URLSearchParams(location.search);
  const [asset, revision] = [query.get("asset"), query.get("revision")];
  const base = asset && revision ? `/v1/assets/${part(asset)}/revisions/${part(revision)}` : ONE_CONTAINER;
  if (asset) replace(element("crumbs"), h("a", {href: `/#/asset/${part(asset)}`}, asset), ` / ${revision}`);
  container = await loadContainer(base, text => say(text));
  element("title").textContent = container.manifest.asset;
  document.title = `${container.manifest.asset} – Patina viewer`;
  showFacts();
  const shown = showPreview();
  say("Compiling");
  start();
  await shown;
  say("Ready", "up");
  performance.mark("patina-shown");
}

// The address of a newer `patina view` on the same port is this page to the browser.
addEventListener("hashchange", () => {
  if (location.hash.startsWith("#token=")) location.reload();
});
begin().catch(complain);
