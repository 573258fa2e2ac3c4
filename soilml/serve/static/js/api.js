// Questions to the server. Every failure is one sentence for the user.

export class Failure extends Error {}

const GONE = "The server does not answer: it was ended, or restarted on another port.";

async function request(path, init) {
  let answer;
  try {
    answer = await fetch(path, init);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Failure(GONE);
  }
  let content = null;
  try {
    content = await answer.json();
  } catch {
    throw new Failure(GONE);
  }
  if (content && content.error && content.state === undefined) throw new Failure(content.error);
  return content;
}

export const get = (path) => request(path, { method: "GET" });

export const ask = (path, content) =>
  request(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(content),
  });

export const end = (job) =>
  request(`/api/jobs/${job}`, { method: "DELETE", headers: { "Content-Type": "application/json" } });

/** Send a file; its key on the server. */
export function upload(file) {
  return request(`/api/files?name=${encodeURIComponent(file.name)}`, {
    method: "PUT",
    headers: { "Content-Type": "application/octet-stream" },
    body: file,
  });
}

export const jobFile = (job, name, show = false) =>
  `/api/jobs/${job}/${encodeURIComponent(name)}${show ? "?show=1" : ""}`;
