// One job: how far it is, what it learns, why it waits, what it printed, and what can be done about it.
import {ApiError, get, openFile, part, post, text} from "./api.js";
import {announce, bytes, decibels, duration, facts, failure, h, isFinal, moment, progressBar, progressText, refresh, replace, stateMark, stateName} from "./dom.js";
import {accuracyPlot} from "./plot.js";
import {reloader} from "./reload.js";

const LOG_BYTES = 65536;

function verdict(job) {
  if (job.state === "running") return job.cancel_requested ? "It is being stopped." : `At work: ${progressText(job.progress)}.`;
  if (job.waiting_reason) return `It waits: ${job.waiting_reason}.`;
  if (job.state === "succeeded") return job.revision ? `Published as ${job.revision}.` : "Done.";
  if (job.error) return `${stateName(job.state)}: ${job.error.message.split("\n")[0]}`;
  return `${stateName(job.state)}.`;
}

export function jobView(parameters, argument) {
  const id = /^[0-9]{1,18}$/.test(argument) ? argument : "0";
  const heading = h("h1", {tabindex: "-1"}, `Job ${id}`);
  const trouble = h("div", {});
  const head = h("div", {});
  const progress = h("div", {});
  const plot = h("div", {});
  const log = h("pre", {class: "log", tabindex: "0", "aria-label": "Log of the job"});
  const detail = h("div", {});
  const element = h("div", {}, h("p", {class: "kind"}, h("a", {href: "#/queue"}, "Queue"), ` / job ${id}`), heading, trouble, head, progress,
    h("section", {"aria-labelledby": "curve-title"}, h("h2", {id: "curve-title"}, "Accuracy against time"), plot),
    h("section", {"aria-labelledby": "log-title"}, h("h2", {id: "log-title"}, "Log"), log), detail);
  let job = null;
  let offset = -LOG_BYTES;
  let curveAt = 0, stage = "";

  async function act(action, said) {
    try {
      await post(`/v1/jobs/${id}/${action}`);
      announce(said);
      await loader.now();
    } catch (error) {
      replace(trouble, failure(error));
    }
  }

  function showProgress() {
    refresh(progress, job.state === "running" && h("p", {class: "bar-line"}, progressBar(job.progress, "Progress of this stage")));
  }

  function showHead() {
    heading.textContent = job.asset;
    const result = job.result || {};
    const quality = result.psnr ? ["of mip 0", decibels(result.psnr.mip0)]
      : ["so far", decibels(job.progress && job.progress.psnr_db > 0 ? job.progress.psnr_db : NaN)];
    const waits = ["queued", "retry_waiting"].includes(job.state);
    const cells = [["state", stateMark(job.state)], quality];
    if (job.state === "running") {
      cells.push(["the next 10 s add", job.progress && job.progress.gain_10s_db > 0 ? `+${job.progress.gain_10s_db.toFixed(2)} dB` : "–"]);
      cells.push(["left of this stage", duration(job.progress ? job.progress.eta_s : NaN)]);
    } else {
      cells.push(["for an engine", result.bytes ? bytes(result.bytes) : "–"]);
      cells.push(["took", duration(result.seconds)]);
    }
    cells.push(["attempt", `${job.attempt}`], ["submitted", moment(job.created)]);
    refresh(head, h("p", {class: job.error && isFinal(job.state) ? "verdict bad" : "verdict"}, verdict(job)), facts(cells),
      h("p", {class: "actions"},
        !isFinal(job.state) && !job.cancel_requested &&
          h("button", {type: "button", "data-key": "cancel", onclick: () => act("cancel", "The job is being cancelled")}, "Cancel"),
        ["failed", "cancelled", "buried", "retry_waiting"].includes(job.state) &&
          h("button", {type: "button", class: "main", "data-key": "retry", onclick: () => act("retry", "The job is queued again")}, "Retry"),
        waits && h("button", {type: "button", "data-key": "hold",
          onclick: () => act(job.held ? "release" : "hold", job.held ? "The job may start" : "The job is held back")}, job.held ? "Release" : "Hold back"),
        h("a", {href: `#/asset/${part(job.asset)}`, "data-key": "asset"}, "The asset"),
        job.state === "succeeded" && job.revision && h("a", {href: "#report", "data-key": "report", onclick: event => {
          event.preventDefault();
          openFile(`/v1/assets/${part(job.asset)}/revisions/${part(job.revision)}/files/report.html`).catch(error => replace(trouble, failure(error)));
        }}, "Report")));
    showProgress();
    replace(detail, job.error && h("section", {"aria-labelledby": "error-title"}, h("h2", {id: "error-title"}, "What went wrong"),
      h("pre", {class: "log", tabindex: "0"}, `${job.error.code}: ${job.error.message}`)),
    h("section", {}, h("details", {}, h("summary", {}, "The job as it was submitted"),
      h("pre", {class: "log", tabindex: "0"}, JSON.stringify(job.job || {}, null, 2)))));
  }

  async function loadCurve() {
    curveAt = Date.now();
    const {points} = await get(`/v1/jobs/${id}/curve`);
    if (loader.isClosed()) return;
    if (points.length === 0) {
      replace(plot, h("p", {class: "quiet"}, job.state === "running" ? "The first figures come with the training." : "Nothing was learned."));
    } else {
      replace(plot, accuracyPlot(points, job.state === "running", plot.clientWidth));
    }
  }

  async function loadLog() {
    for (let pieces = 0; pieces < 16 && !loader.isClosed(); ++pieces) {
      const chunk = await text(`/v1/jobs/${id}/log?offset=${offset}&limit=${LOG_BYTES}`);
      const follows = log.scrollTop + log.clientHeight >= log.scrollHeight - 8;
      offset = chunk.next;
      log.append(chunk.text);
      log.normalize();
      // What is older than the last pieces is on disk, and in `patina logs`.
      if (log.textContent.length > 8 * LOG_BYTES) log.textContent = log.textContent.slice(-4 * LOG_BYTES);
      if (log.textContent === "") log.dataset.empty = "Nothing was printed yet.";
      if (follows) log.scrollTop = log.scrollHeight;
      if (chunk.text.length === 0 || chunk.complete) return;
    }
  }

  const loader = reloader(async () => {
    const before = job && job.state;
    job = await get(`/v1/jobs/${id}`);
    if (loader.isClosed()) return;
    replace(trouble);
    showHead();
    if (before && before !== job.state) announce(`${job.asset}: ${stateName(job.state)}`);
    await Promise.all([loadCurve(), loadLog()]);
  }, error => replace(trouble, failure(error instanceof ApiError && error.status === 404
    ? new Error("There is no such job: it ended long ago and was removed, or never was.") : error)));
  const ready = loader.now();

  return {
    element, ready, title: `Job ${id}`, page: "queue",
    event(event) {
      if (event.type === "reset") loader.soon();
      if (String(event.job) !== id || !job) return;
      if (event.type !== "progress") {
        loader.soon();
        return;
      }
      job.progress = event.data;
      if (event.data.stage !== stage) {
        stage = event.data.stage;
        announce(`${job.asset}: ${progressText(event.data)}`);
      }
      if (job.state !== "running" || Date.now() - curveAt > 2000) loader.soon();
      else showHead();
    },
    close: loader.close
  };
}
