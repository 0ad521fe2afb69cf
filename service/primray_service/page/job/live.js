// Delivers a job's events as they happen. EventSource reconnects by itself after a broken connection; after an answer that is
// not a stream (the server restarts, a key expired) it gives up, so a new one is made after a while, from the last event seen.
// Listeners read the job again on "open", so that they miss nothing that happened in between.

const WAIT_S = [1, 2, 4, 8, 15];
const TYPES = ["state", "progress", "preview", "frame", "warning", "queue", "end"];

export function live(url, { onEvent, onOpen, onLost }) {
  let source = null;
  let failures = 0;
  let timer = 0;
  let last = 0;

  function start() {
    stop();
    source = new EventSource(`${url}?after=${last}`);
    source.addEventListener("open", () => {
      failures = 0;
      onOpen();
    });
    source.addEventListener("error", () => {
      onLost();
      if (source?.readyState !== EventSource.CLOSED) return;
      timer = setTimeout(start, 1000 * WAIT_S[Math.min(failures, WAIT_S.length - 1)]);
      failures += 1;
    });
    for (const type of TYPES) source.addEventListener(type, (event) => dispatch(type, event));
  }

  function dispatch(type, event) {
    last = Number(event.lastEventId) || last;
    let data;
    try {
      data = JSON.parse(event.data);
    } catch {
      return;
    }
    onEvent(type, data);
  }

  function stop() {
    clearTimeout(timer);
    source?.close();
    source = null;
  }

  return { start, stop };
}
