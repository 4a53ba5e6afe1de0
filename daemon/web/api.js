// The daemon's HTTP API as this page uses it.

const KEPT = "patina-token";
let ask = () => Promise.reject(new Error("no token"));
let asking = null;

// Who is asked for the token when the daemon wants one: a function of whether an earlier one was wrong.
export function onTokenWanted(callback) {
  ask = callback;
}

export class ApiError extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

function headers(extra) {
  const token = sessionStorage.getItem(KEPT);
  return token ? {...extra, Authorization: `Bearer ${token}`} : {...extra};
}

async function problemOf(response) {
  try {
    const problem = await response.json();
    return String(problem.detail || problem.title || response.status);
  } catch {
    return `the daemon answers ${response.status}`;
  }
}

// A fetch with the token, which is asked for where it is missing or wrong.
async function request(path, options = {}) {
  for (;;) {
    const sent = sessionStorage.getItem(KEPT);
    const response = await fetch(path, {...options, headers: headers(options.headers), cache: "no-store", redirect: "error"});
    if (response.status === 401) {
      // Another request may have been given the token meanwhile.
      if (sessionStorage.getItem(KEPT) !== sent) continue;
      asking = asking || ask(Boolean(sent)).finally(() => { asking = null; });
      sessionStorage.setItem(KEPT, await asking);
      continue;
    }
    if (!response.ok) throw new ApiError(response.status, await problemOf(response));
    return response;
  }
}

export async function get(path, options) {
  return (await request(path, options)).json();
}

export async function text(path, options) {
  const response = await request(path, options);
  return {text: await response.text(), next: Number(response.headers.get("Patina-Next-Offset")),
    complete: response.headers.get("Patina-Log-Complete") === "true"};
}

export async function blob(path, options) {
  return (await request(path, options)).blob();
}

export async function bytes(path, options) {
  return (await request(path, options)).arrayBuffer();
}

// Of an address that carries it.
export function keepToken(token) {
  sessionStorage.setItem(KEPT, token);
}

export async function post(path, body = {}, options = {}) {
  const response = await request(path, {...options, method: "POST", body: JSON.stringify(body),
    headers: {"Content-Type": "application/json"}});
  return response.json();
}

export async function sendPiece(path, piece, options = {}) {
  const response = await request(path, {...options, method: "POST", body: piece,
    headers: {"Content-Type": "application/octet-stream"}});
  return response.json();
}

export function part(name) {
  return encodeURIComponent(name);
}

// Opens a file of a container in a tab of its own: a link cannot carry the token, so it gets a ticket.
export async function openFile(path) {
  const tab = window.open("about:blank", "_blank");
  try {
    const ticket = await post("/v1/tickets", {path: decodeURIComponent(path)});
    if (tab) {
      tab.opener = null;
      tab.location.replace(path + ticket.url);
    } else {
      window.location.assign(path + ticket.url);
    }
  } catch (error) {
    if (tab) tab.close();
    throw error;
  }
}

// Follows the daemon's events for as long as the page lives. tell(event): {type, job, data, time}, and {type: "reset"}
// when some were lost; link(isUp).
export async function follow(tell, link) {
  let last = "";
  let broken = false;
  for (;;) {
    try {
      const response = await request("/v1/events", {headers: last ? {"Last-Event-ID": last} : {}});
      link(true);
      if (broken) tell({type: "reset", data: {}});
      broken = true;
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const {value, done} = await reader.read();
        if (done) break;
        const blocks = (rest + value).split("\n\n");
        rest = blocks.pop();
        for (const block of blocks) {
          const fields = {};
          for (const line of block.split("\n")) {
            const colon = line.indexOf(": ");
            if (colon > 0) fields[line.slice(0, colon)] = line.slice(colon + 2);
          }
          if (fields.id) last = fields.id;
          if (!fields.event) continue;
          let event = {};
          try { event = JSON.parse(fields.data); } catch { continue; }
          tell({...event, type: fields.event, data: event.data || {}});
        }
      }
    } catch {
      // Said by link, and tried again.
    }
    link(false);
    await new Promise(resolve => setTimeout(resolve, 2000));
  }
}
