// The module's functions (web/src/abi.rs) as JavaScript: text and arrays in and out.

const bytesOf = (text) => new TextEncoder().encode(text);

// Instantiates the module and opens the weights in it, both fetched from beside this file.
// `heard` is told how much of the weights is there, 0 to 1.
export async function openStudio(heard) {
  const answer = await fetched("dance.wasm");
  const [{ instance }, weights] = await Promise.all([
    WebAssembly.instantiateStreaming(answer, {}).catch(async () =>
      // A server that calls the file something else than application/wasm.
      WebAssembly.instantiate(await (await fetched("dance.wasm")).arrayBuffer(), {}),
    ),
    download("weights.safetensors", heard),
  ]);
  const module = instance.exports;
  const bytesAt = (at, count) => new Uint8Array(module.memory.buffer, at, count);
  const numbersAt = (at, count) => new Float32Array(module.memory.buffer, at, count).slice();
  const text = () => new TextDecoder().decode(bytesAt(module.text_at(), module.text_bytes()));
  // Puts bytes where the module looks for them, and calls it.
  const call = (name, bytes = new Uint8Array(), count = bytes.length) => {
    bytesAt(module.input(bytes.length), bytes.length).set(bytes);
    if (module[name](count) < 0) throw new Error(text());
    return text();
  };
  const rows = () => ({
    music: numbersAt(module.music_at(), module.music_numbers()),
    robot: numbersAt(module.robot_at(), module.robot_numbers()),
  });
  const choices = JSON.parse(call("open", weights));
  return {
    choices,
    // Begins a dance; its scene.
    start: (options) => JSON.parse(call("start", bytesOf(JSON.stringify(options)))),
    // Dances to a Float32Array of samples; the rows that come of it.
    hear(samples) {
      call("hear", new Uint8Array(samples.buffer, samples.byteOffset, samples.byteLength), samples.length);
      return rows();
    },
    finish() {
      call("finish");
      return rows();
    },
    setStyle: (name) => call("set_style", bytesOf(name)),
    // The built-in song: its samples and their rate.
    song() {
      const rate_hz = module.song();
      return { samples: numbersAt(module.song_at(), module.song_samples()), rate_hz };
    },
  };
}

async function fetched(name) {
  const answer = await fetch(new URL(name, import.meta.url));
  if (!answer.ok) throw new Error(`${name} is not there (${answer.status})`);
  return answer;
}

async function download(name, heard) {
  const answer = await fetched(name);
  const size = Number(answer.headers.get("Content-Length")) || 0;
  const parts = [];
  let count = 0;
  for (const reader = answer.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    count += value.length;
    if (size > 0) heard(Math.min(count / size, 1));
  }
  const all = new Uint8Array(count);
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}
