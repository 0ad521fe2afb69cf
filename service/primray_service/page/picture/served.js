// A job's picture as the server shows it: the next preview is fetched and decoded behind the one that is seen, then they swap.

import { drop, fetchPicture } from "./picture.js";

const AGAIN_S = 0.15; // after there was no picture where one was expected
const ASK_S = 4; // a worker writes pictures only while somebody asks; it forgets after 10 s

// `onImage(image, before, size)`: the next <img>, the one that it takes the place of, the whole picture's size; `onScale` and
// `onTrouble` tell the rest.
export function served(job, { onImage, onScale, onTrouble, onSeen = () => {} }) {
  let state = {};
  let front = null; // the <img> that is seen
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

  // A page that is not looked at does not ask; it does at once when it is.
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

  // There is a picture now, or a newer one.
  function refresh() {
    isThere = true;
    ask();
  }

  return {
    set,
    refresh,
    // While something else is shown in its place.
    pause: (now) => {
      if (now === isPaused) return;
      isPaused = now;
      if (!now) {
        tag = ""; // so that its scale is told again
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
