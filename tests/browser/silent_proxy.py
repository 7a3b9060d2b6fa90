"""A TCP relay that can fall silent: connections stay open and are taken, nothing passes."""

import socket
import threading


class SilentProxy:
    """Relays to one port of this machine; `silent` is set and cleared by the test."""

    def __init__(self, port):
        self.target = ("127.0.0.1", port)
        self.speaks = threading.Event()
        self.speaks.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def fall_silent(self):
        self.speaks.clear()

    def speak(self):
        self.speaks.set()

    def _accept(self):
        while True:
            client, _ = self.listener.accept()
            threading.Thread(target=self._relay, args=(client,), daemon=True).start()

    def _relay(self, client):
        self.speaks.wait()
        try:
            server = socket.create_connection(self.target)
        except OSError:
            client.close()
            return
        back = threading.Thread(target=self._pass, args=(server, client), daemon=True)
        back.start()
        self._pass(client, server)

    def _pass(self, source, sink):
        try:
            while data := source.recv(65536):
                self.speaks.wait()
                sink.sendall(data)
        except OSError:
            pass
        self.speaks.wait()
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
