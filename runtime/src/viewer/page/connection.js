// The line to the program: frames in, requests out, tried again when it breaks. A heartbeat
// goes both ways: the program sends a frame at least five times a second, an operator's page
// says four times a second that it is open in front of somebody.

const AGAIN_MS = 500;
const ALIVE_MS = 250;
const LOOK_MS = 100;
// No frame for so long is a silence; then a new line is tried.
const SILENT_S = 0.5;
const NEW_LINE_S = 2;
const POST_MS = 1000;

export function connect({ operator, onFrame, onRefused, onSilence }) {
  const seconds = () => performance.now() / 1000;
  let socket = null;
  let heard = seconds();
  let opened = 0;

  const open = () => {
    const address = new URL("api/live", location.href);
    address.protocol = location.protocol.replace("http", "ws");
    const line = new WebSocket(address);
    line.onmessage = (event) => {
      const message = JSON.parse(event.data);
      heard = seconds();
      if (message.refused) onRefused(message.refused);
      else onFrame(message);
    };
    line.onclose = () => {
      if (line === socket) setTimeout(() => line === socket && open(), AGAIN_MS);
    };
    [socket, opened] = [line, seconds()];
  };
  open();

  setInterval(() => {
    const now = seconds();
    onSilence(now - heard > SILENT_S ? now - heard : 0);
    // A line on which nothing comes may be dead without being closed.
    if (now - Math.max(heard, opened) > NEW_LINE_S) {
      const dead = socket;
      open();
      dead.close();
    }
  }, LOOK_MS);

  const send = (request) => {
    const up = socket.readyState === WebSocket.OPEN;
    if (up) socket.send(JSON.stringify(request));
    return up;
  };
  // What the program answers; throws if it cannot be reached.
  const post = async (request) => {
    const headers = { "Content-Type": "application/json" };
    const [method, body, signal] = ["POST", JSON.stringify(request), AbortSignal.timeout(POST_MS)];
    return (await fetch("api/command", { method, headers, body, signal })).json();
  };
  const ask = async (request) => {
    onRefused("");
    if (send(request)) return;
    try {
      const answer = await post(request);
      if (answer.error) onRefused(answer.error);
    } catch {
      onRefused("the program cannot be reached");
    }
  };
  if (operator) {
    setInterval(() => document.visibilityState === "visible" && send({ do: "alive" }), ALIVE_MS);
  }
  return { ask, send, post };
}
