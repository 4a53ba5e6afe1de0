// The dashboard: which view is shown, and what reaches it.
import {follow, onTokenWanted} from "./api.js";
import {replace} from "./dom.js";
import {assetsView, assetView} from "./assets.js";
import {jobView} from "./job.js";
import {machineView} from "./machine.js";
import {queueView} from "./queue.js";
import {askForToken} from "./token.js";

const VIEWS = {queue: queueView, job: jobView, assets: assetsView, asset: assetView, machine: machineView};
const main = document.getElementById("main");
let current = null;

function show(isFirst) {
  const [path, query] = location.hash.replace(/^#\/?/, "").split("?");
  const [name, ...rest] = path.split("/");
  if (!isFirst && name === "main") return;
  let argument = "";
  try { argument = decodeURIComponent(rest.join("/")); } catch { /* no name that could be one */ }
  const make = Object.hasOwn(VIEWS, name) ? VIEWS[name] : queueView;
  if (current) current.close();
  current = make(new URLSearchParams(query || ""), argument);
  document.title = `${current.title} – Patina`;
  replace(main, current.element);
  for (const link of document.querySelectorAll("[data-page]")) {
    if (link.dataset.page === current.page) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  if (!isFirst) {
    window.scrollTo(0, 0);
    const heading = main.querySelector("h1");
    if (heading) heading.focus({preventScroll: true});
  }
  current.ready.then(() => performance.mark("patina-shown"));
}

onTokenWanted(askForToken);

// ---- files that are dropped anywhere

const veil = document.getElementById("veil");
const holdsFiles = event => event.dataTransfer && [...event.dataTransfer.types].includes("Files");
addEventListener("dragover", event => {
  if (!holdsFiles(event)) return;
  event.preventDefault();
  veil.hidden = false;
});
addEventListener("dragleave", event => {
  if (event.relatedTarget === null) veil.hidden = true;
});
addEventListener("drop", event => {
  if (!holdsFiles(event)) return;
  event.preventDefault();
  veil.hidden = true;
  if (!current.drop) {
    history.pushState(null, "", "#/queue");
    show(false);
  }
  current.drop(event.dataTransfer);
});

// ---- begin

addEventListener("hashchange", () => show(false));
document.querySelector(".skip").addEventListener("click", event => {
  event.preventDefault();
  main.focus();
});
show(true);
const link = document.getElementById("link");
current.ready.then(() => follow(event => current.event(event), isUp => {
  link.textContent = isUp ? "Live" : "Not connected";
  link.className = isUp ? "link up" : "link down";
}));
