// The way to the server: commands one after the other, in order; moves of the mouse that wait are added up meanwhile.

export async function stage() {
  return (await fetch("stage")).json();
}

const waiting = [];
let sending = false;
let told = () => {};

// `refused` hears of commands that could not be carried out, and of a server that does not answer.
export function onRefused(refused) {
  told = refused;
}

export function tell(command) {
  waiting.push(command);
  void send();
}

// As `tell`, added to a move of the same kind that has not been sent yet.
export function move(kind, amounts) {
  const last = waiting.at(-1);
  if (last?.do !== kind) return tell({ do: kind, ...amounts });
  for (const [name, amount] of Object.entries(amounts)) last[name] += amount;
  return undefined;
}

async function send() {
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
      if (!answer.ok) told(await answer.json());
    } catch {
      waiting.length = 0;
      told({ title: "The viewer does not answer" });
    }
  }
  sending = false;
}
