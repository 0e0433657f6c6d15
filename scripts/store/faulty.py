"""An HTTP proxy on loopback that misbehaves as told: what networks and busy object stores do to requests.

    proxy = FaultyProxy(port_of_the_server, seed=1)
    proxy.faults = {"busy": 0.1, "cut": 0.1}     # each request meets one of these, or none
    proxy.injected                               # how many of each there were
    proxy.google = True                          # what is asked in Google's dialect of S3 is put into S3's

Faults: `broken` (500) and `busy` (503 SlowDown) instead of an answer; `lost` (the server did it, the answer is a 500); `deaf`
(the connection closes without an answer), `dropped` (the same after the server did it); `cut` (half of the body, then a reset),
`short` (half of the body, then an orderly end); `slow` (late, and in pieces); `conflict` (409, to create-only puts alone);
`denied` (403 with the body that S3 sends, which repeats the key); `hang` (nothing at all, until the client gives up);
`elsewhere` (302 to `proxy.other`); `flood` (10^15 bytes are announced, and come); `drip` (one byte per 0.5 s); `flipped` (a put is
stored with a flipped bit).
"""

import collections
import http.client
import http.server
import random
import socket
import struct
import threading
import time

DENIED = (
    b"<?xml version='1.0'?><Error><Code>SignatureDoesNotMatch</Code><Message>The request signature we calculated does not match"
    b"</Message><AWSAccessKeyId>%s</AWSAccessKeyId><StringToSign>AWS4-HMAC-SHA256 %s</StringToSign></Error>"
)

# What the S3 server takes for signed; it checks no signature.
AWS = "AWS4-HMAC-SHA256 Credential=AKID/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0"


def error(code):
    return f"<?xml version='1.0'?><Error><Code>{code}</Code></Error>".encode()


class FaultyProxy:
    def __init__(self, upstream, seed):
        self.upstream, self.faults, self.injected = upstream, {}, collections.Counter()
        self.requests, self.google, self.other = 0, False, "http://127.0.0.1:9"
        self._random, self._lock = random.Random(seed), threading.Lock()
        proxy = self

        class Handler(_Handler):
            pass

        Handler.proxy = proxy
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def choose(self, is_create):
        with self._lock:
            self.requests += 1
            draw = self._random.random()
            for fault, share in self.faults.items():
                if draw < share:
                    if fault == "conflict" and not is_create:
                        return None
                    self.injected[fault] += 1
                    return fault
                draw -= share
        return None

    def close(self):
        self._server.shutdown()
        self._server.server_close()


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def handle(self):
        try:
            super().handle()
        except OSError:
            pass

    def do_GET(self):
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        headers = {name: value for name, value in self.headers.items() if name.lower() != "connection"}
        if self.proxy.google:
            headers = {name: value for name, value in headers.items() if name.lower() != "authorization"}
            headers["Authorization"] = AWS
            if headers.pop("x-goog-if-generation-match", None) == "0":
                headers["If-None-Match"] = "*"
        fault = self.proxy.choose(any(name.lower() == "if-none-match" for name in headers))
        if fault == "hang":
            time.sleep(60)
        if fault in ("deaf", "hang"):
            return self.hang_up(reset=True)
        if fault == "broken":
            return self.answer(500, error("InternalError"))
        if fault == "busy":
            return self.answer(503, error("SlowDown"))
        if fault == "conflict":
            return self.answer(409, error("ConditionalRequestConflict"))
        if fault == "denied":
            authorization = self.headers.get("Authorization", "").encode()
            key = authorization.split(b"Credential=")[-1].split(b"/")[0]
            return self.answer(403, DENIED % (key, authorization))
        if fault == "elsewhere":
            return self.answer(302, b"", [("Location", self.proxy.other + self.path)])
        if fault in ("flood", "drip"):
            return self.go_on(b"x" if fault == "drip" else bytes(1 << 16), 0.5 if fault == "drip" else 0)
        if fault == "flipped" and self.command == "PUT" and body:
            body = bytes([body[0] ^ 1]) + body[1:]
            headers = {name: value for name, value in headers.items() if not name.lower().startswith("x-amz-")}
            headers["Authorization"] = AWS
        status, answer_headers, answer = self.forward(headers, body)
        if fault == "lost":
            return self.answer(500, error("InternalError"))
        if fault == "dropped":
            return self.hang_up(reset=True)
        if fault == "slow":
            time.sleep(0.4)
        half = len(answer) // 2 if fault in ("cut", "short") and self.command != "HEAD" else None
        self.answer(status, answer, answer_headers, slow=fault == "slow", stop_at=half)
        if half is not None:
            self.hang_up(reset=fault == "cut")

    do_PUT = do_POST = do_DELETE = do_HEAD = do_GET

    def forward(self, headers, body):
        server = http.client.HTTPConnection("127.0.0.1", self.proxy.upstream, timeout=60)
        try:
            server.request(self.command, self.path, body=body or None, headers=headers)
            answer = server.getresponse()
            return answer.status, answer.getheaders(), answer.read()
        finally:
            server.close()

    def answer(self, status, body, headers=(), slow=False, stop_at=None):
        self.send_response_only(status)
        length = len(body)
        for name, value in headers:
            if name.lower() == "content-length" and self.command == "HEAD":
                length = value
            elif name.lower() not in ("content-length", "connection", "transfer-encoding"):
                self.send_header(name, value)
        self.send_header("Content-Length", str(length))
        self.end_headers()
        if self.command == "HEAD":
            return
        body = body[:stop_at] if stop_at is not None else body
        pieces = 4 if slow else 1
        step = max(1, -(-len(body) // pieces))
        for start in range(0, len(body), step):
            self.wfile.write(body[start : start + step])
            self.wfile.flush()
            if slow:
                time.sleep(0.1)

    def go_on(self, piece, pause):
        """An answer that does not end before the client hangs up."""
        self.send_response_only(200)
        for name, value in (("Content-Length", 10**15), ("ETag", '"one"'), ("Last-Modified", "Sat, 21 Nov 2026 00:00:00 GMT")):
            self.send_header(name, str(value))
        self.end_headers()
        self.close_connection = True
        if self.command != "HEAD":
            while True:
                self.wfile.write(piece)
                self.wfile.flush()
                time.sleep(pause)

    def hang_up(self, reset):
        self.close_connection = True
        if reset:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        else:
            self.connection.shutdown(socket.SHUT_RDWR)
        self.connection.close()
