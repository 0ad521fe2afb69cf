// A job's picture as rendered by the server: the next preview is fetched and decoded behind the visible one, then they swap.

import { drop, fetchPicture } from "./picture.js";

const AGAIN_S = 0.15; // after a picture was expected and not there yet
const ASK_S = 4; // a worker writes pictures only while they are requested: for 10 s after each request

// `onImage(image, before, size)` is called with the next <img>, the one that it replaces, and the whole picture's size;
// `onScale`, `onTrouble` and `onSeen` with the scale of its colours, what is wrong (or ""), and its display view.
export function served(job, { onImage, onScale, onTrouble, onSeen = () => {} }) {
  let state = {};
  let front = null; // the visible <img>
  let [isThere, isLive, isWanted, isLoading, isPaused, closed] = [false, true, false, false, false, false];
  let [tag, shownAs, timer] = ["", "", 0];

  function set(changes) {
    const before = JSON.stringify(state);
    state = { ...state, ...changes };
    if (JSON.stringify(state) !== before) ask();
  }

  function ask() {
    isWanted = true;
    if (isThere && !isLoading && !isPaused && !closed) load();
  }

  async function load() {
    clearTimeout(timer);
    [isWanted, isLoading] = [false, true];
    const source = JSON.stringify(state);
    let pause = ASK_S;
    try {
      const found = await fetchPicture(job, state, tag);
      if (found.image) swap(found.image, found.size);
      [tag, shownAs] = [found.tag, source];
      if (!isPaused) onScale(found.scale);
      if (!isPaused) onSeen(found.seen);
      onTrouble("");
    } catch (failure) {
      if (!failure.problem) throw failure;
      if (!front) pause = Math.max(AGAIN_S, failure.retryAfter ?? 0);
      const isStale = shownAs && shownAs !== source && failure.problem.status !== 0;
      if (failure.problem.status === 422 || isStale) onTrouble(failure.problem.detail);
    } finally {
      isLoading = false;
    }
    if (closed) return;
    if (isWanted) ask();
    else if (isLive) timer = setTimeout(() => (document.hidden ? (isWanted = true) : ask()), 1000 * pause);
  }

  // A page in the background sends no requests; it sends one as soon as it is visible.
  const seen = () => !document.hidden && isWanted && ask();
  document.addEventListener("visibilitychange", seen);

  function swap(next, size) {
    if (closed) {
      drop(next);
      return;
    }
    const before = front;
    front = next;
    onImage(next, before, size);
    drop(before);
  }

  // A first or newer picture is available.
  function refresh() {
    isThere = true;
    ask();
  }

  return {
    set,
    refresh,
    // Pauses while something else is shown in its place.
    pause: (now) => {
      if (now === isPaused) return;
      isPaused = now;
      if (!now) {
        tag = ""; // so that its scale is reported again
        ask();
      }
    },
    live: (now, hasPicture) => {
      const ended = isLive && !now;
      isLive = now;
      if (hasPicture && (ended || !isThere)) refresh();
    },
    isThere: (now) => (isThere = now),
    close: () => {
      closed = true;
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", seen);
      drop(front);
    },
  };
}
