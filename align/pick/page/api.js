// The server's answers. URLs are relative: the token is the first part of this page's path.

// `kind`: "refused" (the server says no, `message` is its sentence), "gone" (it does not answer) or
// "restarted" (something answers, but no longer at this address: a new server has a new token).
export class ServerError extends Error {
  constructor(kind, message, status = 0) {
    super(message);
    this.kind = kind;
    this.status = status;
  }
}

const kPatience = 15000;  // milliseconds

// A question that is answered at once by a server that is well: with no answer after a while (the
// machine sleeps, a tunnel hangs) the server is taken to be gone.
async function askBriefly(path, init = {}) {
  const giveUp = new AbortController();
  const timer = setTimeout(() => giveUp.abort(), kPatience);
  try {
    return await ask(path, {...init, signal: giveUp.signal});
  } catch (error) {
    if (error.name !== 'AbortError') throw error;
    throw new ServerError('gone', 'the server does not answer');
  } finally {
    clearTimeout(timer);
  }
}

async function ask(path, init = {}) {
  let response;
  try {
    response = await fetch(path, init);
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new ServerError('gone', 'the server does not answer');
  }
  let answer = null;
  try {
    answer = await response.json();
  } catch (error) {
    if (error.name === 'AbortError') throw error;
  }
  if (response.ok && answer !== null) return answer;
  if (response.status === 403) {  // its token is another one
    throw new ServerError('restarted', 'the server was started anew and has a new address');
  }
  if (answer && answer.error && response.status < 500) {
    throw new ServerError('refused', answer.error, response.status);
  }
  throw new ServerError('gone', (answer && answer.error) || `the server says ${response.status}`);
}

function bodyOf(method, body) {
  return {method, headers: {'Content-Type': 'application/json'}, body: JSON.stringify(body)};
}

export const api = {
  state: () => askBriefly('state'),
  scanPoint: (scan, x, y) => ask(`scan_point?scan=${scan}&x=${x}&y=${y}`),
  corner: (photo, [x, y], reach) => ask(`corner?photo=${photo}&x=${x}&y=${y}&reach=${reach}`),
  putPicks: (revision, picks) => askBriefly('picks', bodyOf('PUT', {revision, picks})),
  edges: (photo, solution, signal) => ask(`edges?photo=${photo}&solution=${solution}`, {signal}),
  startAlign: () => ask('align', bodyOf('POST', {})),
  endAlign: () => ask('align', bodyOf('DELETE', {})),
  align: () => askBriefly('align'),
  mirror: () => ask('mirror', bodyOf('POST', {})),

  photoTile: (photo) => (level, x, y) => `tile?photo=${photo}&level=${level}&x=${x}&y=${y}`,
  scanTile: (scan, picture) => (level, x, y) =>
      `tile?scan=${scan}&picture=${picture}&level=${level}&x=${x}&y=${y}`,
  backTile: (photo, scan, solution) => (level, x, y) =>
      `tile?back=${photo}&scan=${scan}&solution=${solution}&level=${level}&x=${x}&y=${y}`,
  thumbnail: (photo) => `thumbnail?photo=${photo}`,
  overlay: (name) => `overlay?name=${encodeURIComponent(name)}`,
};
