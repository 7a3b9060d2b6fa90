// What this browser hears, sent to the robot as it comes: without what telephones do to it.

export async function openMicrophone(onEnd) {
  const wanted = { echoCancellation: false, noiseSuppression: false, autoGainControl: false };
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ audio: wanted });
  } catch (error) {
    throw new Error(error.name === "NotAllowedError" ? "the browser allows no microphone" : "there is no microphone");
  }
  const context = new AudioContext();
  await context.audioWorklet.addModule("capture.js");
  const capture = new AudioWorkletNode(context, "capture", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
  const address = new URL("api/microphone", location.href);
  address.protocol = location.protocol.replace("http", "ws");
  const line = new WebSocket(address);
  const close = () => {
    capture.port.onmessage = null;
    stream.getTracks().forEach((track) => track.stop());
    context.close();
    line.onclose = null;
    line.close();
  };
  line.onopen = () => {
    line.send(String(context.sampleRate));
    capture.port.onmessage = ({ data }) => line.send(data);
    new MediaStreamAudioSourceNode(context, { mediaStream: stream }).connect(capture);
  };
  line.onclose = onEnd;
  await context.resume();
  return { close };
}
