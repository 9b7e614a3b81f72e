"""A pigpio daemon without a Pi: it speaks the socket protocol and records the pulses."""

import socket
import struct
import threading
from contextlib import suppress


class PigpioDaemon:
    """Answers SERVO, PFG, PRRG and PIGPV on a port of this host, as pigpiod does."""

    def __init__(self, sample_us: int = 5) -> None:
        self.sample_us = sample_us
        self.pulses: dict[int, int] = {}
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._clients: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def drop_clients(self) -> None:
        """Break every connection."""
        for client in self._clients:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        self._clients.clear()

    def close(self) -> None:
        """Stop answering."""
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.drop_clients()
        for thread in self._threads:
            thread.join()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._server.accept()
            except OSError:
                return
            self._clients.append(client)
            thread = threading.Thread(target=self._serve, args=(client,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            while len(request := client.recv(16, socket.MSG_WAITALL)) == 16:
                command, first, second, _ = struct.unpack("<IIII", request)
                client.sendall(struct.pack("<IIIi", command, first, second, self._answer(command, first, second)))

    def _answer(self, command: int, first: int, second: int) -> int:
        if command == 8:
            if second != 0 and not 500 <= second <= 2500:
                return -7
            if first == 28:
                return -41
            self.pulses[first] = second
            return 0
        return {23: 800, 24: 1_000_000 // 800 // self.sample_us, 26: 79}.get(command, -88)
