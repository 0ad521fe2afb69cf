// Sends commands in order, one after the other; moves that wait are added up meanwhile. Each command has a token, which comes
// back with the first picture that shows it: the time from the hand to the eye is measured by that.

const PICTURELESS = ["pivot", "select", "explain", "deselect", "exposure", "display", "mix"]; // no new picture is rendered for these

// `post(command)` carries a command out; its promise is kept with the problem if it was refused, else with null. `refused` is
// called with the problem of a command that was not carried out, and where `post` fails.
export function sender(post, refused) {
  const page = Math.random().toString(36).slice(2, 8); // another page of the same viewer has tokens of its own
  const waiting = [];
  const begun = new Map(); // when the first event of each command happened, by its number
  const awaited = new Map(); // who waits for the picture of each command, by its number
  let last = 0;
  let sending = false;

  function send(command) {
    last += 1;
    if (!PICTURELESS.includes(command.do)) begun.set(last, performance.now());
    waiting.push({ ...command, token: `${page}-${last}` });
    void sendWaiting();
  }

  // Sends a command; the promise is kept once a picture that shows it is on the screen.
  function sendAndSee(command) {
    send(command);
    return new Promise((resolve) => awaited.set(last, resolve));
  }

  // Sends a command, added to one of the same kind that has not been sent yet.
  function move(kind, amounts) {
    const latest = waiting.at(-1);
    if (latest?.do !== kind) return send({ do: kind, ...amounts });
    for (const [name, amount] of Object.entries(amounts)) latest[name] += amount;
    return undefined;
  }

  // Notes that the picture with a token is on the screen; the seconds since the first event that it shows, or null.
  function seen(token) {
    const [whose, number] = (token ?? "").split("-");
    if (whose !== page) return null;
    for (const [key, resolve] of [...awaited].filter(([key]) => key <= Number(number))) {
      awaited.delete(key);
      resolve();
    }
    const times = [...begun.keys()].filter((key) => key <= Number(number));
    if (times.length === 0) return null;
    const start = begun.get(times[0]);
    for (const key of times) begun.delete(key);
    performance.measure("step", { start, end: performance.now() });
    return (performance.now() - start) / 1000;
  }

  async function sendWaiting() {
    if (sending) return;
    sending = true;
    while (waiting.length > 0) {
      try {
        const problem = await post(waiting.shift());
        if (problem) refused(problem);
      } catch {
        waiting.length = 0;
        refused({ title: "The viewer does not answer" });
      }
    }
    sending = false;
  }

  return { send, sendAndSee, move, seen };
}
