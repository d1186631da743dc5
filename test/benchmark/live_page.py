#!/usr/bin/env python3
"""What the live page costs a run, and how late it is: H1 in realtime at 3 Hz, unwatched, watched by one client, and by
one while ten others come and go and one takes nothing.

live_page.py HYBRID_SLAM DATA [FRAMES [hybrid|stereo]]     DATA: folder with uwsynth/hybrid; FRAMES: of the sequence (120)

Times from when a frame's images were handed to the SLAM, and from its result, to their arrival here, by this machine's
clock. CPU time of the threads that serve and feed the page, and of the whole process.
"""

import json
import os
import resource
import socket
import subprocess
import sys
import tempfile
import threading
import time


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def connected(port, receive_buffer=0):
    """A client of the events, as soon as there is a server. None once the run is over."""
    for _ in range(6000):
        client = socket.socket()
        if receive_buffer:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        if client.connect_ex(("127.0.0.1", port)) == 0:
            client.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
            return client
        client.close()
        time.sleep(0.01)
    return None


def events(client):
    """Name, data and time of arrival of each event until the stream ends."""
    text = b""
    while True:
        more = client.recv(1 << 20)
        now = time.time()
        if not more:
            return
        text += more
        while b"\n\n" in text:
            block, text = text.split(b"\n\n", 1)
            fields = {}
            for line in block.replace(b"\r\n", b"\n").split(b"\n"):  # sizes of chunks stand between
                for name in (b"event: ", b"data: "):
                    if line.startswith(name):
                        fields[name] = line[len(name):]
            if len(fields) == 2:
                yield fields[b"event: "].decode(), fields[b"data: "], now


def view_ticks(pid, ticks):
    """CPU time of the page's threads, into ticks by thread."""
    try:
        for thread in os.listdir("/proc/%d/task" % pid):
            with open("/proc/%d/task/%s/stat" % (pid, thread), encoding="utf-8") as file:
                name, _, rest = file.read().partition("(")[2].rpartition(")")
            if name.startswith("view"):
                ticks[name, thread] = sum(map(int, rest.split()[11:13]))
    except OSError:  # a thread, or all, has just ended
        pass


def watch(port, late):
    for name, data, now in events(connected(port)):
        if name not in ("frame", "picture"):
            continue
        told = json.loads(data)
        for since in ("pushed", "told"):
            if told.get(since):
                late.setdefault((name, since), []).append(1e3 * (now - told[since]))


def come_and_go(port, over):
    """Ten at a time for a second each, half of which read; one all the time, which never reads."""
    stalled, visits = connected(port, 2048), 0
    while not over.is_set():
        visitors = [connected(port) for _ in range(10)]
        visits += 10
        for visitor in visitors[::2]:
            visitor.recv(1 << 16)
        over.wait(1)
        for visitor in visitors:
            visitor.close()
    stalled.close()
    print("    %d visitors" % visits)


def run(name, arguments, frames, clients):
    port, late, ticks, over = free_port(), {}, {}, threading.Event()
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        slam = subprocess.Popen([*arguments, "--limit", str(frames), "--view", str(port), "--out", folder], stdout=subprocess.DEVNULL)
        threads = []
        if clients:
            threads.append(threading.Thread(target=watch, args=(port, late), daemon=True))
        if clients == "crowd":
            threads.append(threading.Thread(target=come_and_go, args=(port, over), daemon=True))
        for thread in threads:
            thread.start()
        begin = time.monotonic()
        while slam.poll() is None:
            view_ticks(slam.pid, ticks)
            if time.monotonic() - begin > frames / 3 - 2:
                over.set()  # the crowd goes before the run ends
            time.sleep(0.2)
        wall = time.monotonic() - begin
        for thread in threads:
            thread.join()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        with open(os.path.join(folder, "summary.json"), encoding="utf-8") as file:
            summary = json.load(file)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    page = sum(ticks.values()) / os.sysconf("SC_CLK_TCK")
    print("%s: exit code %d, %.1f s; tracked %d, fisheye %d, dropped %d; CPU time %.1f s, of it the page %.2f s (%.1f %% of a core)" % (
        name, slam.returncode, wall, summary["frames"]["tracked"], summary.get("fisheye", {}).get("frames", {}).get("registered", 0),
        summary["frames"]["dropped"], cpu, page, 300 * page / frames))
    for (what, since), values in sorted(late.items()):
        values.sort()
        print("    %-7s from %-6s to client: p50 %.0f, p95 %.0f, max %.0f ms (%d)" % (
            what, since, values[len(values) // 2], values[int(0.95 * (len(values) - 1))], values[-1], len(values)))


def main():
    program, data = sys.argv[1:3]
    frames = int(sys.argv[3]) if len(sys.argv) > 3 else 120
    arguments = [program, os.path.join(data, "uwsynth", "hybrid"), "--sequence", "H1", "--mode", "realtime", "--rate", "3", "--quiet",
                 "--report", "off", "--cameras", sys.argv[4] if len(sys.argv) > 4 else "hybrid"]
    run("unwatched", arguments, frames, "")
    run("watched", arguments, frames, "one")
    run("watched by a crowd", arguments, frames, "crowd")


main()
