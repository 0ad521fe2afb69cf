// Sends commands to the server, in order, one after the other; moves of the mouse that wait are added up meanwhile.

export async function stage() {
  return (await fetch("stage")).json();
}

const waiting = [];
let sending = false;
let onProblem = () => {};

// `refused` is called with the problem of a command that was not carried out, and if the server does not answer.
export function onRefused(refused) {
  onProblem = refused;
}

export function send(command) {
  waiting.push(command);
  void sendWaiting();
}

// Sends a command, added to one of the same kind that has not been sent yet.
export function move(kind, amounts) {
  const last = waiting.at(-1);
  if (last?.do !== kind) return send({ do: kind, ...amounts });
  for (const [name, amount] of Object.entries(amounts)) last[name] += amount;
  return undefined;
}

async function sendWaiting() {
  if (sending) return;
  sending = true;
  while (waiting.length > 0) {
    const command = waiting.shift();
    try {
      const answer = await fetch("commands", {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify(command),
      });
      if (!answer.ok) onProblem(await answer.json());
    } catch {
      waiting.length = 0;
      onProblem({ title: "The viewer does not answer" });
    }
  }
  sending = false;
}
