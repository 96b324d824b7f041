// The server's answers. URLs are relative: the token is the first part of this page's path.

async function ask(path, method = 'GET', body = undefined) {
  let response;
  try {
    response = await fetch(path, {
      method,
      headers: body === undefined ? {} : {'Content-Type': 'application/json'},
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw new Error('The server does not answer: start roomtex-outline again.');
  }
  if (response.status === 403) {
    throw new Error('The server was started anew and has a new address.');
  }
  return response;
}

async function askJson(...request) {
  const response = await ask(...request);
  const answer = await response.json().catch(() => null);
  if (!response.ok || answer === null) {
    throw new Error(answer?.error ?? `The server says ${response.status}.`);
  }
  return answer;
}

export const api = {
  state: () => askJson('state'),
  // {positions: Float32Array, colors: Uint8Array}
  points: async (count) => {
    const bytes = await (await ask('points')).arrayBuffer();
    const split = 12 * count;
    return {positions: new Float32Array(bytes, 0, 3 * count), colors: new Uint8Array(bytes, split)};
  },
  put: (revision, buildings) => askJson('buildings', 'PUT', {revision, buildings}),
  propose: (area) => askJson('propose', 'POST', area ? {area} : {}),
  heights: (building) => askJson('heights', 'POST', {building}),
  up: (revision, up) => askJson('up', 'POST', {revision, up}),
  models: () => askJson('models', 'POST', {}),
};
