// The line to the program: frames in, requests out, tried again when it breaks.

const AGAIN_MS = 1000;

export function connect({ onFrame, onRefused, onLink }) {
  let socket = null;

  const open = () => {
    const address = new URL("api/live", location.href);
    address.protocol = "ws:";
    socket = new WebSocket(address);
    socket.onopen = () => onLink(true);
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      if (message.refused) onRefused(message.refused);
      else onFrame(message);
    };
    socket.onclose = () => {
      onLink(false);
      setTimeout(open, AGAIN_MS);
    };
  };
  open();

  // By the socket if it is open, else by HTTP: a stop must get through.
  const ask = async (request) => {
    onRefused("");
    const text = JSON.stringify(request);
    if (socket.readyState === WebSocket.OPEN) {
      socket.send(text);
      return;
    }
    try {
      const headers = { "Content-Type": "application/json" };
      const answer = await fetch("api/command", { method: "POST", headers, body: text });
      if (!answer.ok) onRefused((await answer.json()).error);
    } catch {
      onRefused("the program cannot be reached: use the power switch");
    }
  };
  return { ask };
}
