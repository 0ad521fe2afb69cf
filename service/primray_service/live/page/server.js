// The viewer's server, which commands are sent to.

import { sender } from "../page/live/sender.js";

export async function stage() {
  return (await fetch("stage")).json();
}

let onProblem = () => {};

// `refused` is called with the problem of a command that was not carried out, and if the server does not answer.
export function onRefused(refused) {
  onProblem = refused;
}

export function refuse(problem) {
  onProblem(problem);
}

export const commands = sender(post, refuse);
export const { send, sendAndSee, seen } = commands;

async function post(command) {
  const answer = await fetch("commands", {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(command),
  });
  return answer.ok ? null : answer.json();
}
