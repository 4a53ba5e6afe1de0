// Sends files to be baked: dropped ones, or those of a file input. What lies in one folder becomes one upload.
import {part, post, sendPiece} from "./api.js";
import {announce, bytes, h, replace} from "./dom.js";

const PIECE = 1 << 20;

// Everything that was dropped, folders with all that is in them: [{path, file}].
async function dropped(transfer) {
  const found = [];
  const entries = [...transfer.items].map(item => item.webkitGetAsEntry && item.webkitGetAsEntry()).filter(entry => entry);
  if (entries.length === 0) return [...transfer.files].map(file => ({path: file.name, file}));
  const walk = async (entry, path) => {
    if (entry.isFile) {
      found.push({path, file: await new Promise((resolve, reject) => entry.file(resolve, reject))});
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (some.length === 0) return;
      for (const one of some) await walk(one, `${path}/${one.name}`);
    }
  };
  for (const entry of entries) await walk(entry, entry.name);
  return found;
}

function nameFrom(text) {
  return text.replace(/[^A-Za-z0-9_.-]+/g, "_").replace(/^[-._]+/, "").slice(0, 80) || "upload";
}

// What all names begin with, up to a separator: "wall_ao.png", "wall_col.png" give "wall".
function common(names) {
  let prefix = names[0].replace(/\.[^.]*$/, "");
  for (const name of names) {
    while (prefix && !name.startsWith(prefix)) prefix = prefix.slice(0, -1);
  }
  const trimmed = names.length > 1 ? prefix.replace(/[^_.\- ]*$/, match => (names.every(name => /^[_.\- ]/.test(name.slice(prefix.length))) ? match : "")) : prefix;
  return trimmed.replace(/[_.\- ]+$/, "") || prefix || names[0];
}

// Groups by the topmost folder; loose files are one group. Files that systems leave behind are left out.
function groups(files) {
  const byFolder = new Map();
  for (const {path, file} of files) {
    const parts = path.split("/");
    if (parts.some(name => name.startsWith(".") || name === "Thumbs.db" || name === "desktop.ini")) continue;
    const folder = parts.length > 1 ? parts[0] : "";
    if (!byFolder.has(folder)) byFolder.set(folder, []);
    byFolder.get(folder).push({path: parts.length > 1 ? parts.slice(1).join("/") : path, file});
  }
  return [...byFolder].map(([folder, list]) => ({
    name: nameFrom(folder || common(list.map(one => one.path))), files: list,
    size: list.reduce((sum, one) => sum + one.file.size, 0)
  }));
}

async function send(group, quality, row) {
  const stop = new AbortController();
  const bar = h("progress", {max: String(Math.max(group.size, 1)), value: 0, "aria-label": `Sending ${group.name}`});
  const said = h("p", {class: "quiet"}, `${group.files.length} ${group.files.length === 1 ? "file" : "files"}, ${bytes(group.size)}`);
  const cancel = h("button", {type: "button", onclick: () => stop.abort()}, "Cancel", h("span", {class: "unseen"}, ` sending ${group.name}`));
  replace(row, h("p", {class: "name"}, group.name), bar, said, cancel);
  let upload = null;
  try {
    upload = await post("/v1/uploads", {name: group.name, files: group.files.map(({path, file}) => ({name: path, bytes: file.size}))},
      {signal: stop.signal});
    const piece = Math.min(PIECE, upload.piece_bytes);
    let sent = 0;
    for (const {path, file} of group.files) {
      const where = `${upload.url}/files/${path.split("/").map(part).join("/")}`;
      for (let at = 0; at < file.size; at += piece) {
        const blob = file.slice(at, at + piece);
        await sendPiece(`${where}?offset=${at}`, blob, {signal: stop.signal});
        sent += blob.size;
        bar.value = sent;
        said.textContent = `${bytes(sent)} of ${bytes(group.size)}`;
      }
    }
    bar.removeAttribute("value");
    said.textContent = "Looking at what it is";
    const made = await post(`${upload.url}/submit`, {quality}, {signal: stop.signal});
    upload = null;
    replace(row, h("p", {class: "name"}, group.name),
      h("ul", {}, made.jobs.map(job => h("li", {}, h("a", {href: `#/job/${job.id}`}, `Job ${job.id}: ${job.asset}`))),
        made.refused.map(one => h("li", {class: "bad"}, `${one.asset}: ${one.detail}`))));
    announce(`${group.name} was sent: ${made.jobs.length} ${made.jobs.length === 1 ? "job" : "jobs"}`);
  } catch (error) {
    const stopped = stop.signal.aborted;
    if (upload) post(`${upload.url}/drop`).catch(() => {});
    replace(row, h("p", {class: "name"}, group.name),
      h("p", {class: stopped ? "quiet" : "problem", role: stopped ? undefined : "alert"}, stopped ? "Not sent." : error.message));
  }
}

// One for the life of the page: sending goes on while other views are looked at.
let only = null;
export function uploadPanel() {
  only = only || makePanel();
  return only;
}

function makePanel() {
  const rows = h("ul", {class: "cards wide sent"});
  const quality = h("select", {id: "quality"},
    h("option", {value: "preview"}, "preview: seconds"), h("option", {value: "standard", selected: true}, "standard: a minute or so"),
    h("option", {value: "reference"}, "reference: minutes"));
  let queue = Promise.resolve();
  const take = files => {
    const found = groups(files);
    if (found.length === 0) {
      announce("There are no files in that");
      return;
    }
    for (const group of found) {
      const row = h("li", {}, h("p", {class: "name"}, group.name), h("p", {class: "quiet"}, "waits to be sent"));
      rows.append(row);
      queue = queue.then(() => send(group, quality.value, row));
    }
  };
  const input = (id, folder) => h("input", {type: "file", id, multiple: true, webkitdirectory: folder, class: "unseen",
    onchange: event => {
      take([...event.target.files].map(file => ({path: file.webkitRelativePath || file.name, file})));
      event.target.value = "";
    }});
  const element = h("section", {class: "bring", "aria-labelledby": "bring-title"}, h("h2", {id: "bring-title"}, "Bake something"),
    h("p", {}, "Drop the maps of a material, a measured BRDF or a folder of them anywhere on this page, or choose them:"),
    h("div", {class: "actions"},
      input("files", false), h("label", {for: "files", class: "button main"}, "Choose files"),
      input("folder", true), h("label", {for: "folder", class: "button"}, "Choose a folder"),
      h("span", {class: "pair"}, h("label", {for: "quality"}, "Quality"), quality)),
    rows);
  return {element, drop: async transfer => take(await dropped(transfer))};
}
