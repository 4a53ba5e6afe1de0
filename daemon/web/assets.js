// The assets: a page of them with pictures, sizes and quality; and one with all its revisions side by side.
import {ApiError, blob, get, openFile, part} from "./api.js";
import {announce, brief, bytes, decibels, facts, failure, h, moment, refresh, replace, stateMark, table} from "./dom.js";

const PAGE = 24;
const COMPARED = 4;
// How a preview is laid out, in pixels: pictures of at most TILE a side in columns, the first two of them the source and
// what was decoded.
const TILE = 192, LEFT = 10, TOP = 76, COLUMN = TILE + 10;

function canvasOf(alt, width, height) {
  return h("canvas", {role: "img", "aria-label": alt, width, height});
}

// The preview of a container. On a canvas: an image of the page could not send the token.
async function sheet(path, alt) {
  const image = await createImageBitmap(await blob(path));
  const canvas = canvasOf(alt, image.width, image.height);
  canvas.getContext("2d").drawImage(image, 0, 0);
  image.close();
  return canvas;
}

// Source and decoded of the first map alone, cut out of the preview.
async function pair(path, alt, manifest) {
  const image = await createImageBitmap(await blob(path));
  const {width = TILE, height = TILE} = manifest.source || {};
  const scale = Math.min(1, TILE / Math.max(width, height));
  const [across, down] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
  const canvas = canvasOf(alt, 2 * TILE, TILE);
  const context = canvas.getContext("2d");
  for (const column of [0, 1])
    context.drawImage(image, LEFT + column * COLUMN, TOP, across, down, column * TILE, 0, TILE - (column === 0 ? 2 : 0), TILE);
  image.close();
  return canvas;
}

// The figures of a manifest, in the order in which they are shown: [name, text, number, whether more is better].
function figuresOf(manifest, listed) {
  const rows = [];
  const quality = manifest.quality || {};
  const add = (name, value, show, better) => {
    if (Number.isFinite(value)) rows.push({name, value, text: show(value), better});
  };
  const fixed = digits => value => value.toFixed(digits);
  const psnr = quality.psnr_db || {};
  add("PSNR of mip 0", psnr.mip0, decibels, 1);
  add("PSNR of all mips", psnr.overall, decibels, 1);
  add("mean PSNR of the mips", psnr.mean_mips, decibels, 1);
  add("SSIM", quality.ssim, fixed(4), 1);
  add("FLIP", quality.flip, fixed(4), -1);
  for (const map of quality.maps || []) add(`${map.map}, all mips`, map.overall && map.overall.psnr_db, decibels, 1);
  // Of a BRDF whatever single numbers its quality has.
  if (!quality.psnr_db) {
    for (const [name, value] of Object.entries(quality)) {
      if (typeof value === "number") add(name.replaceAll("_", " "), value, number => number.toPrecision(4), 0);
    }
  }
  add("for an engine", engineBytes(manifest), bytes, -1);
  add("all files", listed && listed.bytes, bytes, -1);
  add("training samples", manifest.training && manifest.training.samples, value => value.toExponential(2), 0);
  add("recipe version", manifest.tool && manifest.tool.recipe_version, String, 0);
  add("seed", manifest.seed, String, 0);
  return rows;
}

function engineBytes(manifest) {
  return (manifest.payloads || []).filter(payload => !["preview", "report"].includes(payload.role))
    .reduce((sum, payload) => sum + payload.bytes, 0);
}

function headline(manifest) {
  const quality = manifest.quality || {};
  if (quality.psnr_db) return decibels(quality.psnr_db.mip0);
  return Number.isFinite(quality.ssim) ? `SSIM ${quality.ssim.toFixed(4)}` : "–";
}

export function assetsView(parameters) {
  const cursors = parameters.getAll("after");
  const trouble = h("div", {});
  const list = h("div", {});
  const element = h("div", {}, h("h1", {tabindex: "-1"}, "Assets"), trouble, list);
  let closed = false;
  let timer = 0;
  const link = names => "#/assets" + (names.length > 0 ? `?${new URLSearchParams(names.map(name => ["after", name]))}` : "");
  const kept = new Map();  // by asset and revision: what was loaded of a container

  // Pictures and figures are fetched when their card comes into view.
  const seen = new IntersectionObserver(entries => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      seen.unobserve(entry.target);
      fillCard(entry.target);
    }
  }, {rootMargin: "200px"});
  const waiting = new WeakMap();

  async function fillCard(card) {
    const {asset, view, figures} = waiting.get(card);
    const base = `/v1/assets/${part(asset.name)}/files/`;
    const key = `${asset.name}/${asset.revision}`;
    try {
      if (!kept.has(key)) {
        kept.set(key, get(`${base}manifest.json`).then(async manifest => [manifest,
          await pair(`${base}preview.png`, `${asset.name}: source and decoded`, manifest).catch(() => null)]));
      }
      const [manifest, drawn] = await kept.get(key);
      if (closed) return;
      if (drawn) replace(view, drawn);
      replace(figures, h("b", {}, headline(manifest)), `, ${bytes(engineBytes(manifest))}`);
    } catch {
      kept.delete(key);
      replace(figures, "no container to read");
    }
  }

  function card(asset) {
    const view = h("div", {class: "picture"});
    const figures = h("p", {class: "figures"});
    const element = h("li", {}, view,
      h("p", {class: "name"}, h("a", {href: `#/asset/${part(asset.name)}`, "data-key": `asset${asset.name}`}, asset.name)),
      h("p", {}, stateMark(asset.state), asset.revision && h("small", {class: "quiet"}, ` ${asset.revision}`)),
      asset.revision && figures, asset.reason && h("p", {class: "quiet reason"}, brief(asset.reason)));
    if (asset.revision) {
      waiting.set(element, {asset, view, figures});
      seen.observe(element);
    } else {
      view.append(h("span", {class: "quiet"}, "no container yet"));
    }
    return element;
  }

  async function load() {
    try {
      const after = cursors.length > 0 ? `&cursor=${part(cursors[cursors.length - 1])}` : "";
      const page = await get(`/v1/assets?limit=${PAGE}${after}`);
      if (closed) return;
      replace(trouble);
      if (page.assets.length === 0) {
        refresh(list, h("p", {class: "quiet"}, cursors.length > 0 ? "No more assets."
          : "None yet. Drop files onto this page, or put them into a watched folder."));
        return;
      }
      refresh(list, h("ul", {class: "cards"}, page.assets.map(card)),
        h("nav", {class: "pages", "aria-label": "Pages of assets"},
          cursors.length > 0 && h("a", {href: link(cursors.slice(0, -1)), "data-key": "back"}, "Back"),
          page.next_cursor && h("a", {href: link([...cursors, page.next_cursor]), "data-key": "next"}, "Next")));
    } catch (error) {
      if (!closed) replace(trouble, failure(error));
    }
  }
  const ready = load();
  return {
    element, ready, title: "Assets", page: "assets",
    event(event) {
      if (event.type === "progress" || timer !== 0) return;
      timer = setTimeout(() => { timer = 0; load(); }, 1000);
    },
    close() {
      closed = true;
      clearTimeout(timer);
      seen.disconnect();
    }
  };
}

export function assetView(parameters, name) {
  const base = `/v1/assets/${part(name)}`;
  const trouble = h("div", {});
  const head = h("div", {});
  const view = h("div", {class: "sheet"});
  const compared = h("div", {});
  const jobs = h("div", {});
  const element = h("div", {}, h("p", {class: "kind"}, h("a", {href: "#/assets"}, "Assets"), " / asset"),
    h("h1", {tabindex: "-1"}, name), trouble, head,
    h("section", {"aria-labelledby": "revisions-title"}, h("h2", {id: "revisions-title"}, "Revisions"), compared),
    h("section", {"aria-labelledby": "view-title"}, h("h2", {id: "view-title"}, "Source and decoded"), view),
    h("section", {"aria-labelledby": "made-title"}, h("h2", {id: "made-title"}, "Jobs"), jobs));
  let closed = false;
  let timer = 0;
  let shown = "";

  const open = path => event => {
    event.preventDefault();
    openFile(path).catch(error => replace(trouble, failure(error)));
  };

  const viewerOf = revision => `/web/viewer.html?${new URLSearchParams({asset: name, revision})}`;

  function showHead(asset, newest) {
    const cells = [["state", stateMark(asset.state)]];
    if (newest) {
      const {manifest} = newest;
      cells.push(["quality of mip 0", headline(manifest)], ["for an engine", bytes(engineBytes(manifest))]);
      if (manifest.source && manifest.source.width) cells.push(["texels", `${manifest.source.width} × ${manifest.source.height}`]);
      cells.push(["profile", manifest.profile || manifest.kind], ["quality setting", manifest.quality_setting || "–"]);
    }
    if (asset.updated) cells.push(["changed", moment(asset.updated)]);
    refresh(head, asset.reason && h("p", {class: "verdict bad"}, asset.reason.split("\n")[0]), facts(cells),
      asset.revision && h("p", {class: "actions"},
        h("a", {href: viewerOf(asset.revision), class: "button main", "data-key": "view"}, "View it lit"),
        h("a", {href: "#report", class: "button", "data-key": "report", onclick: open(`${base}/files/report.html`)}, "Open the report"),
        h("a", {href: "#manifest", "data-key": "manifest", onclick: open(`${base}/files/manifest.json`)}, "manifest.json"),
        asset.job && h("a", {href: `#/job/${asset.job}`, "data-key": "job"}, "The last job")),
      asset.source && h("p", {class: "quiet path"}, `From ${asset.source}`));
  }

  // One column for each of the newest revisions, and what changed between the newest two.
  function showRevisions(all, read) {
    if (read.length === 0) {
      refresh(compared, h("p", {class: "quiet"}, "None yet."));
      return;
    }
    const columns = read.map(one => new Map(figuresOf(one.manifest, one.listed).map(row => [row.name, row])));
    const names = [...new Set(columns.flatMap(column => [...column.keys()]))];
    const rows = names.map(figure => {
      const cells = columns.map(column => column.has(figure) ? column.get(figure).text : "–");
      if (columns.length > 1) {
        const [a, b] = [columns[0].get(figure), columns[1].get(figure)];
        const change = a && b ? a.value - b.value : NaN;
        const good = a && a.better * change;
        if (a && b && a.better === 0) return [figure, ...cells, change === 0 ? "same" : "differs"];
        cells.push(!Number.isFinite(change) ? "–" : change === 0 ? "same" : h("span", {class: good > 0 ? "good" : good < 0 ? "bad" : ""},
          (change > 0 ? "+" : "−") + (figure.includes("PSNR") || figure.endsWith("all mips") ? `${Math.abs(change).toFixed(2)} dB`
            : figure === "for an engine" || figure === "all files" ? bytes(Math.abs(change)) : Number(Math.abs(change).toPrecision(3)).toString())));
      }
      return [figure, ...cells];
    });
    const reports = ["report", ...read.map(one => h("a", {href: "#report", "data-key": `report${one.listed.revision}`,
      onclick: open(`${base}/revisions/${part(one.listed.revision)}/files/report.html`)}, "open",
      h("span", {class: "unseen"}, ` the report of ${one.listed.revision}`)))];
    const views = ["view", ...read.map(one => h("a", {href: viewerOf(one.listed.revision), "data-key": `view${one.listed.revision}`}, "View",
      h("span", {class: "unseen"}, ` ${one.listed.revision} lit`)))];
    const words = [["published", ...read.map(one => moment(one.listed.published))],
      ["profile", ...read.map(one => one.manifest.profile || "–")],
      ["quality setting", ...read.map(one => one.manifest.quality_setting || "–")], views, reports];
    if (read.length > 1) words.forEach(row => row.push(""));
    const heads = ["", ...read.map(one => one.listed.revision)];
    if (read.length > 1) heads.push("change");
    const current = read.find(one => one.listed.current);
    const caption = (read.length > 1 ? `Change: from ${read[1].listed.revision} to ${read[0].listed.revision}. ` : "The only revision. ") +
      (current ? `${current.listed.revision} is current.` : "");
    refresh(compared, table(caption, heads, [...words, ...rows], "numbers"),
      all.length > read.length && h("p", {class: "quiet"}, `${all.length - read.length} older: ${all.slice(read.length).map(one => one.revision).join(", ")}`));
  }

  async function load() {
    try {
      const asset = await get(base);
      const [{revisions}, made] = await Promise.all([get(`${base}/revisions`), get(`/v1/jobs?asset=${part(name)}&limit=10`)]);
      const read = (await Promise.all(revisions.slice(0, COMPARED).map(async listed => {
        try {
          return {listed, manifest: await get(`${base}/revisions/${part(listed.revision)}/files/manifest.json`)};
        } catch {
          return null;  // pruned meanwhile
        }
      }))).filter(one => one);
      if (closed) return;
      replace(trouble);
      showHead(asset, read.find(one => one.listed.current));
      showRevisions(revisions, read);
      refresh(jobs, made.jobs.length === 0 ? h("p", {class: "quiet"}, "None is kept.")
        : table("Newest first, at most ten", ["Job", "State", "Submitted"], made.jobs.map(job => [
          h("a", {href: `#/job/${job.id}`, "data-key": `job${job.id}`}, `Job ${job.id}`), stateMark(job.state), moment(job.created)])));
      if (asset.revision && asset.revision !== shown) {
        shown = asset.revision;
        const drawn = await sheet(`${base}/files/preview.png`, `${name}: source, decoded and difference of each map`).catch(() => null);
        if (!closed) replace(view, drawn || h("p", {class: "quiet"}, "This container has no preview."));
      } else if (!asset.revision) {
        replace(view, h("p", {class: "quiet"}, "Nothing is baked yet."));
      }
    } catch (error) {
      if (!closed) replace(trouble, failure(error instanceof ApiError && error.status === 404
        ? new Error("There is no such asset.") : error));
    }
  }
  const ready = load();
  return {
    element, ready, title: name, page: "assets",
    event(event) {
      if (event.type === "progress" || timer !== 0) return;
      if (event.type !== "reset" && event.data.asset !== name) return;
      announce(`${name}: ${event.type}`);
      timer = setTimeout(() => { timer = 0; load(); }, 500);
    },
    close() {
      closed = true;
      clearTimeout(timer);
    }
  };
}
