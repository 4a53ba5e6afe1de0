// The queue: what runs now, what waits and why, what has ended; and where files are dropped.
import {get, part, post} from "./api.js";
import {announce, brief, count, duration, failure, facts, h, isFinal, moment, progressBar, progressText, refresh, replace, stateMark, table} from "./dom.js";
import {reloader} from "./reload.js";
import {uploadPanel} from "./upload.js";

const PAGE = 25;
const MOST_RUNNING = 12;
const FILTERS = [
  ["", "All", null],
  ["queued,retry_waiting", "Waiting", ["queued", "retry_waiting"]],
  ["succeeded", "Done", ["succeeded"]],
  ["failed,buried", "Failed", ["failed", "buried"]],
  ["cancelled", "Cancelled", ["cancelled"]]
];

function what(job) {
  if (job.progress) return progressText(job.progress);
  if (job.waiting_reason) return job.waiting_reason;
  if (job.error) return brief(job.error.message);
  if (job.revision) return `published as ${job.revision}`;
  return "";
}

// One job at work, with figures that move.
function runningCard(job, stop) {
  const bar = progressBar(job.progress, `Progress of ${job.asset}`);
  const figures = h("p", {class: "figures"});
  const card = h("li", {class: "running"},
    h("p", {class: "name"}, h("a", {href: `#/job/${job.id}`}, job.asset), h("small", {class: "quiet"}, ` job ${job.id}`)),
    bar, figures,
    h("button", {type: "button", "data-key": `cancel${job.id}`, onclick: () => stop(job)}, "Cancel",
      h("span", {class: "unseen"}, ` ${job.asset}`)));
  const show = progress => {
    if (progress && progress.fraction >= 0) bar.value = progress.fraction;
    else bar.removeAttribute("value");
    const part = progress && progress.fraction >= 0 ? ` ${Math.round(progress.fraction * 100)} %` : "";
    const stage = h("span", {class: "stage"}, ((progress && progress.stage) || "starts") + part);
    const cells = [stage];
    if (progress && progress.psnr_db > 0) cells.push(h("span", {}, h("b", {}, progress.psnr_db.toFixed(2)), " dB so far"));
    if (progress && progress.gain_10s_db > 0) cells.push(h("span", {class: "good"}, `+${progress.gain_10s_db.toFixed(2)} dB in 10 s`));
    if (progress && progress.eta_s >= 0) cells.push(h("span", {}, `${duration(progress.eta_s)} left`));
    if (job.cancel_requested) cells.push(h("span", {class: "bad"}, "being stopped"));
    replace(figures, cells);
  };
  show(job.progress);
  return {card, show};
}

export function queueView(parameters) {
  const state = FILTERS.some(([key]) => key === parameters.get("state")) ? parameters.get("state") : "";
  const cursors = (parameters.get("before") || "").split(".").filter(text => /^[0-9]{1,18}$/.test(text));
  const summary = h("div", {});
  const running = h("div", {});
  const filters = h("nav", {class: "filters", "aria-label": "Jobs by state"});
  const list = h("div", {});
  const trouble = h("div", {});
  const panel = uploadPanel();
  const element = h("div", {},
    h("h1", {tabindex: "-1"}, "Queue"), trouble, summary, panel.element,
    h("section", {"aria-labelledby": "running-title"}, h("h2", {id: "running-title"}, "Running now"), running),
    h("section", {"aria-labelledby": "jobs-title"}, h("h2", {id: "jobs-title"}, "Jobs"), filters, list));
  let cards = new Map();
  let paused = false;

  const link = (toState, toCursors) => {
    const query = new URLSearchParams();
    if (toState) query.set("state", toState);
    if (toCursors.length > 0) query.set("before", toCursors.join("."));
    const text = query.toString();
    return "#/queue" + (text ? `?${text}` : "");
  };

  async function act(path, said) {
    try {
      await post(path);
      announce(said);
      await loader.now();
    } catch (error) {
      replace(trouble, failure(error));
    }
  }
  const stop = job => act(`/v1/jobs/${job.id}/cancel`, `${job.asset} is being cancelled`);

  function showStatus(status) {
    paused = status.queue_paused;
    const jobs = status.jobs;
    refresh(summary,
      facts([
        ["running", count(jobs.running)],
        ["waiting", count((jobs.queued || 0) + (jobs.retry_waiting || 0))],
        ["done", count(jobs.succeeded)],
        ["failed", count((jobs.failed || 0) + (jobs.buried || 0))],
        [status.executor === "local" ? "cores at work" : "jobs on the farm", `${status.cores_used} of ${status.cores}`]
      ]),
      h("p", {class: "actions aside"},
        paused && h("span", {class: "bad"}, "The queue is paused: running jobs go on, no other starts."),
        h("button", {type: "button", "data-key": "pause",
          onclick: () => act(paused ? "/v1/queue/resume" : "/v1/queue/pause", paused ? "The queue goes on" : "The queue is paused")},
          paused ? "Let the queue go on" : "Pause the queue")),
      status.problems.length > 0 && h("ul", {class: "warnings"}, status.problems.map(text => h("li", {}, text))));
    refresh(filters, h("ul", {}, FILTERS.map(([key, name, states]) => {
      const total = states ? states.reduce((sum, one) => sum + (jobs[one] || 0), 0) : Object.values(jobs).reduce((sum, n) => sum + n, 0);
      return h("li", {}, h("a", {href: link(key, []), "data-key": `filter${key}`, "aria-current": key === state && "true"},
        `${name} `, h("span", {class: "quiet"}, count(total))));
    })));
  }

  function showRunning(jobs, total) {
    cards = new Map();
    refresh(running,
      jobs.length === 0 ? h("p", {class: "quiet"}, "Nothing. What is dropped here, or into a watched folder, starts by itself.")
        : h("ul", {class: "cards wide"}, jobs.map(job => {
          const made = runningCard(job, stop);
          cards.set(job.id, made);
          return made.card;
        })),
      total > jobs.length && h("p", {class: "quiet"}, `and ${count(total - jobs.length)} more`));
  }

  function showJobs(page) {
    if (page.jobs.length === 0) {
      refresh(list, h("p", {class: "quiet"}, cursors.length > 0 ? "Nothing older." : "No jobs in this state."));
      return;
    }
    const caption = cursors.length > 0 ? `Older jobs, page ${cursors.length + 1}` : "Newest first";
    refresh(list,
      table(caption, ["Asset", "State", "What", "Submitted"], page.jobs.map(job => [
        h("a", {href: `#/job/${job.id}`, "data-key": `job${job.id}`}, job.asset), stateMark(job.state),
        h("span", {class: isFinal(job.state) && job.error ? "quiet" : ""}, what(job)), moment(job.created)]), "words jobs"),
      h("nav", {class: "pages", "aria-label": "Pages of jobs"},
        cursors.length > 0 && h("a", {href: link(state, cursors.slice(0, -1)), "data-key": "newer"}, "Newer"),
        page.next_cursor && h("a", {href: link(state, [...cursors, page.next_cursor]), "data-key": "older"}, "Older")));
  }

  const loader = reloader(async () => {
    const before = cursors.length > 0 ? `&cursor=${part(cursors[cursors.length - 1])}` : "";
    const [status, atWork, page] = await Promise.all([get("/v1/status"), get(`/v1/jobs?state=running&limit=${MOST_RUNNING}`),
      get(`/v1/jobs?limit=${PAGE}${state ? `&state=${part(state)}` : ""}${before}`)]);
    if (loader.isClosed()) return;
    replace(trouble);
    showStatus(status);
    showRunning(atWork.jobs, status.jobs.running || 0);
    showJobs(page);
  }, error => replace(trouble, failure(error)));
  const ready = loader.now();

  return {
    element, ready, title: "Queue", page: "queue",
    event(event) {
      if (event.type === "progress") {
        const shown = cards.get(event.job);
        if (shown) shown.show(event.data);
      } else {
        loader.soon();
      }
    },
    drop: panel.drop,
    close: loader.close
  };
}
