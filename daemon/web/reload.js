// How a view gets what it shows: one load at a time; what is asked for meanwhile is one more, soon after.

export function reloader(work, failed) {
  let timer = 0, busy = false, again = false, closed = false;
  async function now() {
    if (busy) {
      again = true;
      return;
    }
    busy = true;
    try {
      await work();
    } catch (error) {
      if (!closed) failed(error);
    } finally {
      busy = false;
      if (again) {
        again = false;
        soon();
      }
    }
  }
  function soon() {
    if (timer === 0 && !closed) timer = setTimeout(() => { timer = 0; now(); }, 500);
  }
  return {
    now, soon,
    isClosed: () => closed,
    close() {
      closed = true;
      clearTimeout(timer);
    }
  };
}
