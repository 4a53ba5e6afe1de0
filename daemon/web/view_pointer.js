// Mouse, touch and keys on the picture.

const LEAST_ZOOM = 0.25, MOST_ZOOM = 400, LINE_PIXELS = 14;
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Zooms about a point of the picture, -1 to 1 each way, so that what is there stays there.
export function zoomBy(state, factor, x, y) {
  const before = state.zoom;
  state.zoom = clamp(before * factor, LEAST_ZOOM, MOST_ZOOM);
  state.panX = x - (x - state.panX) * state.zoom / before;
  state.panY = y - (y - state.panY) * state.zoom / before;
}

function turnBy(state, yaw, pitch) {
  state.yaw += yaw;
  state.pitch = clamp(state.pitch + pitch, -Math.PI / 2, Math.PI / 2);
}

// changed(what): "light", "turn", "pan", "zoom" or "wipe"; moving(is): while a drag lasts; reset(): all back.
export function listen(canvas, state, {changed, moving, reset}) {
  const held = new Map();
  let isWiping = false;
  const place = event => {
    const box = canvas.getBoundingClientRect();
    // As the picture has it: the shorter side runs from -1 to 1.
    const side = Math.min(box.width, box.height);
    return {x: (2 * (event.clientX - box.left) - box.width) / side, y: (box.height - 2 * (event.clientY - box.top)) / side,
      across: box.width / side, up: box.height / side};
  };
  const shine = ({x, y}) => {
    const length = Math.max(1, Math.hypot(x, y));
    state.lightX = x / length;
    state.lightY = y / length;
    changed("light");
  };
  const span = () => {
    const [a, b] = [...held.values()];
    return {length: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2};
  };

  // The line between source and decoded is there to be taken hold of.
  const isOnLine = event => {
    const box = canvas.getBoundingClientRect();
    return state.compare === "wipe" && Math.abs(event.clientX - box.left - state.wipe * box.width) < LINE_PIXELS;
  };
  const wipe = event => {
    const box = canvas.getBoundingClientRect();
    state.wipe = clamp((event.clientX - box.left) / box.width, 0, 1);
    changed("wipe");
  };

  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    isWiping = held.size === 0 && isOnLine(event);
    canvas.focus({preventScroll: true});
    held.set(event.pointerId, place(event));
    moving(true);
    if (held.size === 1 && !isWiping && actionOf(event) === "light") shine(place(event));
  });
  const actionOf = event => event.altKey || event.buttons === 4 || event.buttons === 2 ? "pan" : event.shiftKey ? "turn" : state.drag;
  canvas.addEventListener("pointermove", event => {
    if (!held.has(event.pointerId)) {
      canvas.style.cursor = isOnLine(event) ? "ew-resize" : "";
      return;
    }
    if (isWiping) return wipe(event);
    const from = held.get(event.pointerId), to = place(event);
    if (held.size === 2) {
      const before = span();
      held.set(event.pointerId, to);
      const after = span();
      state.panX += (after.x - before.x) / to.across;
      state.panY += (after.y - before.y) / to.up;
      zoomBy(state, after.length / Math.max(before.length, 1e-3), after.x / to.across, after.y / to.up);
      changed("zoom");
      return;
    }
    held.set(event.pointerId, to);
    const action = actionOf(event);
    if (action === "light") return shine(to);
    if (action === "turn") turnBy(state, (to.x - from.x) * 1.6, (from.y - to.y) * 1.6);
    else {
      state.panX += (to.x - from.x) / to.across;
      state.panY += (to.y - from.y) / to.up;
    }
    changed(action);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, event => {
      held.delete(event.pointerId);
      if (held.size === 0) moving(false);
    });
  }
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    const {x, y, across, up} = place(event);
    zoomBy(state, 2 ** (-clamp(event.deltaY, -200, 200) / 250), x / across, y / up);
    changed("zoom");
  }, {passive: false});
  canvas.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey) return;
    const arrow = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (arrow && event.altKey) {
      state.panX += arrow[0] * 0.1;
      state.panY += arrow[1] * 0.1;
      changed("pan");
    } else if (arrow && event.shiftKey) {
      turnBy(state, arrow[0] * 0.1, -arrow[1] * 0.1);
      changed("turn");
    } else if (arrow) {
      shine({x: state.lightX + arrow[0] * 0.08, y: state.lightY + arrow[1] * 0.08});
    } else if (event.key === "+" || event.key === "=" || event.key === "-") {
      zoomBy(state, event.key === "-" ? 0.8 : 1.25, 0, 0);
      changed("zoom");
    } else if (event.key === "0") {
      reset();
    } else {
      return;
    }
    event.preventDefault();
  });
}
