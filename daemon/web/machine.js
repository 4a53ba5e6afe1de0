// The machine and the watcher: is all well, what is looked at and how, and what is not taken up yet.
import {get, post} from "./api.js";
import {announce, count, facts, failure, h, moment, refresh, replace, table} from "./dom.js";

const EVERY_MS = 5000;

export function machineView() {
  const trouble = h("div", {});
  const body = h("div", {});
  const element = h("div", {}, h("h1", {tabindex: "-1"}, "Machine"), trouble, body);
  let closed = false;
  let timer = 0;

  async function rescan() {
    try {
      await post("/v1/watch/rescan");
      announce("All watched folders are looked at again");
      await load();
    } catch (error) {
      replace(trouble, failure(error));
    }
  }

  function show(status) {
    const watch = status.watch;
    const well = status.problems.length === 0 && watch.healthy;
    refresh(body,
      h("p", {class: well ? "verdict good" : "verdict bad"}, well ? "All is well." : "Something needs attention."),
      status.problems.length > 0 && h("ul", {class: "warnings"}, status.problems.map(text => h("li", {}, text))),
      facts([[status.executor === "local" ? "cores at work" : "jobs on the farm", `${status.cores_used} of ${status.cores}`], ["queue", status.queue_paused ? "paused" : status.state],
        ["waiting", count((status.jobs.queued || 0) + (status.jobs.retry_waiting || 0))], ["started", moment(status.started)],
        ["version", status.version], ["process", String(status.pid)]]),
      h("section", {"aria-labelledby": "watch-title"}, h("h2", {id: "watch-title"}, "Watched folders"),
        watch.reason && h("p", {class: "bad"}, watch.reason), watch.cure && h("p", {}, watch.cure),
        watch.roots.length === 0 ? h("p", {class: "quiet"}, "None. patinad --watch DIR takes what is put into a folder.")
          : table("How each is watched", ["Folder", "How", "Because", "Folders", "Assets"], watch.roots.map(root => [
            root.path, root.mode, root.mode_reason, count(root.folders), count(root.assets)])),
        watch.roots.length > 0 && h("p", {}, `Events: ${count(watch.events)}. Overflows: ${count(watch.overflows)}. Full looks: ${count(watch.rescans)}.`),
        watch.roots.length > 0 && h("p", {class: "actions"}, h("button", {type: "button", "data-key": "rescan", onclick: rescan}, "Look at everything again"))),
      h("section", {"aria-labelledby": "pending-title"}, h("h2", {id: "pending-title"}, "Not taken up yet"),
        status.pending.length === 0 ? h("p", {class: "quiet"}, "Nothing waits to become complete.")
          : table(status.pending.length >= 100 ? "The first hundred" : "What is waited for", ["Asset", "Reason", "Where"],
            status.pending.map(pending => [pending.name, pending.reason, pending.path]))),
      h("section", {"aria-labelledby": "places-title"}, h("h2", {id: "places-title"}, "Places"),
        table("On the daemon's machine", ["What", "Where"], [["Containers", status.out], ["State", status.state_dir]])));
  }

  async function load() {
    clearTimeout(timer);
    try {
      const status = await get("/v1/status");
      if (closed) return;
      replace(trouble);
      show(status);
    } catch (error) {
      if (!closed) replace(trouble, failure(error));
    }
    if (!closed) timer = setTimeout(load, EVERY_MS);
  }
  const ready = load();
  return {
    element, ready, title: "Machine", page: "machine",
    event() {},
    close() {
      closed = true;
      clearTimeout(timer);
    }
  };
}
