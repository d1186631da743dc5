#!/usr/bin/env python3
"""Sends H.264 files, picture by picture at one clock, as cameras that are triggered together: over RTSP and over TCP.

camera_streams.py PORT RATE START LEFT RIGHT [FISHEYE]     at rtsp://127.0.0.1:PORT/left, /right and /fisheye, and as they are at the
ports PORT+1, PORT+2 and PORT+3

The files: Annex B, with access unit delimiters, no B frames, three pictures to a group; the first group is the first picture,
three times. It is sent again and again until a line comes on the standard input; then what comes from picture START on. At the end
"over" is printed. Needs Debian's packages python3-gi and gir1.2-gst-rtsp-server-1.0.
"""

import re
import socket
import sys
import threading
import time

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtsp", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtsp, GstRtspServer  # noqa: E402

GROUP = 3
SIDES = ("left", "right", "fisheye")
LAUNCH = ("( appsrc name=source is-live=true format=time do-timestamp=true caps=video/x-h264,stream-format=byte-stream,alignment=au "
          "! h264parse config-interval=-1 ! rtph264pay name=pay0 pt=96 )")


def pictures_of(path):
    with open(path, "rb") as file:
        data = file.read()
    begins = [found.start() for found in re.finditer(b"\0\0\0\1\x09", data)] + [len(data)]
    return [data[begin:end] for begin, end in zip(begins, begins[1:])]


def main():
    port, rate, start = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
    files = dict(zip(SIDES, sys.argv[4:]))
    Gst.init(None)
    server, sources, loop, go = GstRtspServer.RTSPServer(), {}, GLib.MainLoop(), threading.Event()
    server.set_service(port)

    def configured(_, media, side):
        sources[side] = media.get_element().get_by_name_recurse_up("source")

    for side in files:
        factory = GstRtspServer.RTSPMediaFactory()
        factory.set_launch(LAUNCH)
        factory.set_shared(True)
        factory.set_protocols(GstRtsp.RTSPLowerTrans.TCP)  # over TCP: nothing is lost on the way
        factory.connect("media-configure", configured, side)
        server.get_mount_points().add_factory("/" + side, factory)
    server.attach(None)
    plain: dict[str, list[socket.socket]] = {side: [] for side in files}

    def accept(side, listener):
        while True:
            plain[side].append(listener.accept()[0])

    for offset, side in enumerate(plain):
        listener = socket.create_server(("127.0.0.1", int(port) + 1 + offset))
        threading.Thread(target=accept, args=(side, listener), daemon=True).start()

    def send():
        streams = {side: pictures_of(path) for side, path in files.items()}
        due, at = time.monotonic(), 0
        while at < len(streams["left"]):
            for side, source in list(sources.items()):
                source.emit("push-buffer", Gst.Buffer.new_wrapped(streams[side][at]))
            for side, clients in plain.items():
                for client in list(clients):
                    try:
                        client.sendall(streams[side][at])
                    except OSError:  # it has gone
                        clients.remove(client)
            at += 1
            if at % GROUP == 0 and at <= GROUP:
                at = start if go.is_set() else 0
            due += 1 / rate
            time.sleep(max(0, due - time.monotonic()))
        print("over", flush=True)

    threading.Thread(target=lambda: (sys.stdin.readline(), go.set()), daemon=True).start()
    threading.Thread(target=send, daemon=True).start()
    print("ready", flush=True)
    loop.run()


main()
