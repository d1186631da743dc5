"""Chromium and Firefox that nobody sees: one page each, what it said on its console, and what it asked for.

Chromium by its DevTools protocol over a pipe, Firefox by WebDriver BiDi (W3C) over a socket. Also what tests of pages share.
"""

import base64
import csv
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import time

CHROMIUM = [
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update",
    "--remote-debugging-pipe", "--no-first-run", "--hide-scrollbars",
]
FIREFOX = {  # no page of its own, no request of its own, and WebGL on whatever there is
    "app.update.disabledForTesting": True, "browser.aboutwelcome.enabled": False, "browser.shell.checkDefaultBrowser": False,
    "browser.startup.page": 0, "datareporting.policy.dataSubmissionEnabled": False, "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False, "remote.active-protocols": 1, "services.settings.server": "",
    "toolkit.telemetry.reportingpolicy.firstRun": False, "webgl.force-enabled": True,
}
PROGRAMS = {"chromium": ("chromium", "chromium-browser"), "firefox": ("firefox-esr", "firefox")}
SIZES = {"desktop": (1400, 1000), "tablet": (768, 1024)}
PATIENCE = 600  # [s] for what must come, on however busy a machine


def skip(reason):
    print("SKIPPED: " + reason)
    sys.exit(0)


def check(truth, what):
    if not truth:
        sys.exit("failed: " + what)


class Browser:
    """What both have in common. `console`: lines; `asked`: addresses of all requests of the page."""

    def __init__(self, command, **options):
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **options)
        self.number, self.console, self.asked = 0, [], []

    def wait_for(self, expression):
        end = time.monotonic() + PATIENCE
        while not self.value(expression):
            check(time.monotonic() < end, "in time: " + expression)
            time.sleep(0.1)

    def open(self, url):
        self.navigate(url)
        self.wait_for("document.documentElement && document.documentElement.dataset.drawn !== undefined")

    def screenshot(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self.picture()))

    def check_quiet(self, url):
        check(not self.console, "no line on the console: " + "; ".join(self.console[:3]))
        foreign = [one for one in self.asked if not one.startswith((url, "data:", "about:", "blob:"))]
        check(not foreign, "no request that leaves the machine: " + " ".join(foreign))

    def close(self):
        self.process.kill()
        self.process.wait()


class Chromium(Browser):
    def __init__(self, program, profile, size):
        theirs_in, self.out = os.pipe()
        self.into, theirs_out = os.pipe()

        def as_the_protocol_wants():
            # Not onto one another: either may be 3 or 4 already.
            low, high = os.dup(theirs_in), os.dup(theirs_out)
            os.dup2(low, 3)
            os.dup2(high, 4)

        super().__init__([program, *CHROMIUM, "--user-data-dir=" + profile, "--window-size=%d,%d" % size, "about:blank"],
                         preexec_fn=as_the_protocol_wants, close_fds=False)
        os.close(theirs_in)
        os.close(theirs_out)
        self.rest = b""
        targets = self.call("Target.getTargets")["targetInfos"]
        page = [one for one in targets if one["type"] == "page"][0]
        self.session = self.call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(domain + ".enable")
        self.call("Performance.enable", timeDomain="threadTicks")
        self.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)

    def receive(self):
        while b"\0" not in self.rest:
            more = os.read(self.into, 1 << 20)
            check(more, "the browser is there")
            self.rest += more
        text, self.rest = self.rest.split(b"\0", 1)
        message = json.loads(text)
        method, of = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.console.append(json.dumps(of["exceptionDetails"])[:400])
        elif method == "Runtime.consoleAPICalled":
            self.console.append(json.dumps(of["args"])[:400])
        elif method == "Log.entryAdded":
            self.console.append(of["entry"]["text"] + " " + of["entry"].get("url", ""))
        elif method == "Network.requestWillBeSent":
            self.asked.append(of["request"]["url"])
        return message

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if hasattr(self, "session"):
            message["sessionId"] = self.session
        os.write(self.out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                check("error" not in answer, "%s: %s" % (method, answer.get("error")))
                return answer["result"]

    def navigate(self, url):
        self.call("Page.navigate", url=url)

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        check("exceptionDetails" not in result, "%s: %s" % (expression, json.dumps(result)[:500]))
        return result["result"].get("value")

    def picture(self):
        return self.call("Page.captureScreenshot", format="png")["data"]

    def page_seconds(self):
        """CPU time of the page's own thread: script, style, layout [s]."""
        return [one["value"] for one in self.call("Performance.getMetrics")["metrics"] if one["name"] == "TaskDuration"][0]

    def close(self):
        super().close()
        os.close(self.out)
        os.close(self.into)


class Firefox(Browser):
    def __init__(self, program, profile, size):
        os.makedirs(profile)
        with open(os.path.join(profile, "user.js"), "w", encoding="utf-8") as file:
            for name, value in FIREFOX.items():
                file.write("user_pref(%s, %s);\n" % (json.dumps(name), json.dumps(value)))
        self.screen, where = self.virtual_screen()
        super().__init__([program, *([] if self.screen else ["--headless"]), "--no-remote", "--remote-debugging-port=0", "--profile", profile,
                          "about:blank"], env={**os.environ, "HOME": profile, **where})
        self.socket = self.connected(os.path.join(profile, "WebDriverBiDiServer.json"))
        self.call("session.new", capabilities={})
        self.context = self.call("browsingContext.getTree")["contexts"][0]["context"]
        self.call("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self.call("browsingContext.setViewport", context=self.context, viewport={"width": size[0], "height": size[1]})

    @staticmethod
    def virtual_screen():
        """A screen that nobody sees (Debian's package xvfb), where there is one: without a screen Firefox has no WebGL."""
        if not shutil.which("Xvfb"):
            return None, {}
        ours, theirs = os.pipe()
        screen = subprocess.Popen(["Xvfb", "-displayfd", str(theirs), "-screen", "0", "1600x1300x24"], pass_fds=[theirs],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(theirs)
        with os.fdopen(ours) as number:
            return screen, {"DISPLAY": ":" + number.readline().strip()}

    def connected(self, place):
        """The WebSocket (RFC 6455) that Firefox says it listens at."""
        end = time.monotonic() + PATIENCE
        while True:
            check(time.monotonic() < end and self.process.poll() is None, "Firefox listens")
            try:
                with open(place, encoding="utf-8") as file:
                    at = json.load(file)
                break
            except (OSError, ValueError):
                time.sleep(0.1)
        link = socket.create_connection((at["ws_host"], at["ws_port"]), timeout=PATIENCE)
        key = base64.b64encode(os.urandom(16)).decode()
        link.sendall(("GET /session HTTP/1.1\r\nHost: %s:%d\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n\r\n" % (at["ws_host"], at["ws_port"], key)).encode())
        self.stream = link.makefile("rb")
        check(b" 101 " in self.stream.readline(), "Firefox speaks WebDriver BiDi")
        while self.stream.readline().strip():
            pass
        return link

    def send(self, text):
        mask, data = os.urandom(4), text.encode()
        size = len(data)
        head = struct.pack("!BB", 0x81, 0x80 | size) if size < 126 else (
            struct.pack("!BBH", 0x81, 0x80 | 126, size) if size < 65536 else struct.pack("!BBQ", 0x81, 0x80 | 127, size))
        self.socket.sendall(head + mask + bytes(byte ^ mask[i % 4] for i, byte in enumerate(data)))

    def receive(self):
        text, more = b"", True
        while more:
            first, size = self.stream.read(2)
            size &= 127
            if size > 125:
                size = int.from_bytes(self.stream.read(2 if size == 126 else 8), "big")
            part = self.stream.read(size)
            if first & 15 < 8:  # not a ping
                text, more = text + part, not first & 128
        message = json.loads(text)
        method, of = message.get("method"), message.get("params", {})
        if method == "log.entryAdded":
            self.console.append(of["text"] or "")
        elif method == "network.beforeRequestSent":
            self.asked.append(of["request"]["url"])
        return message

    def call(self, method, **params):
        self.number += 1
        self.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                check(answer["type"] == "success", "%s: %s" % (method, json.dumps(answer)[:500]))
                return answer["result"]

    def navigate(self, url):
        self.call("browsingContext.navigate", context=self.context, url=url, wait="none")

    def value(self, expression):
        # As JSON: it is passed back as a string, whatever it is.
        result = self.call("script.evaluate", expression="Promise.resolve(%s).then(value => JSON.stringify(value))" % expression,
                           target={"context": self.context}, awaitPromise=True)
        check(result["type"] == "success", "%s: %s" % (expression, json.dumps(result)[:500]))
        text = result["result"].get("value")
        return None if text is None else json.loads(text)

    def picture(self):
        return self.call("browsingContext.captureScreenshot", context=self.context)["data"]

    def close(self):
        self.socket.close()
        super().close()
        if self.screen:
            self.screen.kill()
            self.screen.wait()


def program_of(kind):
    """Where that browser is; without it the test says that it skips."""
    for name in PROGRAMS[kind]:
        if shutil.which(name):
            return shutil.which(name)
    return skip(PROGRAMS[kind][0] + " is not installed")


def open_browser(kind, folder, name="desktop"):
    """One that begins with nothing, of a size of SIZES; its files lie in `folder`."""
    profile = os.path.join(folder, "%s_%s_%d" % (kind, name, time.monotonic_ns()))
    return {"chromium": Chromium, "firefox": Firefox}[kind](program_of(kind), profile, SIZES[name])


def h1():
    """The rendered sequence H1's dataset."""
    if not os.environ.get("HYBRID_SLAM_DATA"):
        skip("HYBRID_SLAM_DATA is not set")
    dataset = os.path.join(os.environ["HYBRID_SLAM_DATA"], "uwsynth", "hybrid")
    if not os.path.isdir(dataset):
        skip("there is no " + dataset)
    return dataset


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for_server(port):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    sys.exit("failed: a server at %d" % port)


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def json_of(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def cpu_seconds(pid):
    """CPU time of a process and of all that it started and that still run [s]."""
    parents, ticks = {}, {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open("/proc/%s/stat" % name, encoding="utf-8") as file:
                fields = file.read().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        parents[int(name)], ticks[int(name)] = int(fields[1]), sum(map(int, fields[11:15]))

    def belongs(one):
        while one in parents and one != pid:
            one = parents[one]
        return one == pid

    return sum(ticks[one] for one in ticks if belongs(one)) / os.sysconf("SC_CLK_TCK")
