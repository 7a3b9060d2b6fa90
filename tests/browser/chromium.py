"""A headless Chromium over its debugging pipe: no other package is needed.

Commands of the Chrome DevTools Protocol go out and come back as JSON texts
that end in a zero byte, through file descriptors 3 and 4 of the browser.
"""

import base64
import json
import os
import select
import subprocess
import tempfile
import time

ARGUMENTS = [
    "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--hide-scrollbars",
]


class Chromium:
    """One browser with one page; use it in a `with` statement."""

    def __init__(self, program="chromium", patience_s=90, more=()):
        self.patience_s = patience_s
        self.folder = tempfile.TemporaryDirectory(
            prefix="show-browser-", ignore_cleanup_errors=True)  # its children may still write
        to_read, self.out = os.pipe()
        self.into, to_write = os.pipe()
        command = [program, f"--user-data-dir={self.folder.name}", *ARGUMENTS, *more]
        # The browser finds its two ends at descriptors 3 and 4.
        shell = f'exec "$@" 3<&{to_read} 4>&{to_write}'
        self.process = subprocess.Popen(
            ["bash", "-c", shell, "-", *command], pass_fds=(to_read, to_write),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(to_write)
        self.buffer, self.number, self.complaints = b"", 0, []
        target = self.browser("Target.createTarget", url="about:blank")["targetId"]
        attached = self.browser("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.folder.cleanup()

    def browser(self, method, **parameters):
        return self._send({"method": method, "params": parameters})

    def do(self, method, **parameters):
        """A command to the page; what it answers."""
        return self._send({"method": method, "params": parameters, "sessionId": self.session})

    def _send(self, message):
        self.number += 1
        text = json.dumps({"id": self.number, **message}).encode() + b"\0"
        os.write(self.out, text)
        until = time.monotonic() + self.patience_s
        while True:
            answer = self._receive(until)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{message['method']}: {answer['error']}")
                return answer["result"]
            self._note(answer)

    def _receive(self, until):
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.into], [], [], max(0, until - time.monotonic()))
            if not ready:
                raise TimeoutError("the browser does not answer")
            data = os.read(self.into, 1 << 20)
            if not data:
                raise RuntimeError("the browser is gone")
            self.buffer += data
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def _note(self, event):
        """Keeps what a console would show as an error."""
        details = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(details["exceptionDetails"].get("exception", details))
        elif event.get("method") == "Log.entryAdded" and details["entry"]["level"] == "error":
            self.complaints.append(details["entry"]["text"])
        elif event.get("method") == "Runtime.consoleAPICalled" and details["type"] == "error":
            self.complaints.append(details["args"])

    def open(self, address, width, height, mobile=False):
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height,
                deviceScaleFactor=2 if mobile else 1, mobile=mobile)
        self.do("Page.navigate", url=address)

    def ask(self, expression):
        """The value of a JavaScript expression."""
        result = self.do("Runtime.evaluate", expression=expression, returnByValue=True,
                         awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def wait_for(self, expression):
        """Until it is true; not being there yet counts as not being true."""
        until = time.monotonic() + self.patience_s
        while not self.ask(f"(() => {{ try {{ return {expression} }} catch {{ return false }} }})()"):
            if time.monotonic() > until:
                raise TimeoutError(f"never true: {expression}")
            time.sleep(0.1)

    def click(self, selector):
        """A real click in the middle of an element."""
        box = self.ask(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            " e.scrollIntoView({block: 'center'}); const r = e.getBoundingClientRect();"
            " return [r.x + r.width / 2, r.y + r.height / 2]; })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.do("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1],
                    button="left", clickCount=1)

    def key(self, key, code):
        for kind in ("keyDown", "keyUp"):
            self.do("Input.dispatchKeyEvent", type=kind, key=key, code=key,
                    windowsVirtualKeyCode=code)

    def screenshot(self, path=None, whole=False, clip=None):
        """The page as PNG; also written to a file."""
        parameters = {"format": "png", "captureBeyondViewport": whole}
        if clip:
            parameters["clip"] = {**clip, "scale": 1}
        png = base64.b64decode(self.do("Page.captureScreenshot", **parameters)["data"])
        if path:
            with open(path, "wb") as file:
                file.write(png)
        return png
