"""The 3D view beside viser's: frames, clouds that arrive, processor time of the server, and bytes.

    python benchmarks/space.py

120,000 points change 10 times a second, and 300 named boxes move 15 times a second, each by itself.
Chromium draws in software. viser is measured where it is installed: pip install 'viser<1.2'.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from playwright.sync_api import Browser, sync_playwright

from ros_visualise.ui.live.space.nodes import Points, Solids, SpaceNode, solid_row
from ros_visualise.ui.page.server import PageServer
from ros_visualise.ui.server.access import access_rules

POINTS, BOXES = 120_000, 300
CLOUD_S, MOVE_S, WARM_S = 1 / 10, 1 / 15, 6.0
PORT = 8471
FLAGS = ["--no-sandbox", "--disable-gpu", "--use-angle=swiftshader"]
FLAGS += ["--enable-unsafe-swiftshader"]
COUNT = """
window.frames_ = window.clouds_ = 0;
let isDrawn = false;
for (const Kind of [window.WebGLRenderingContext, window.WebGL2RenderingContext]) {
  const own = Kind.prototype;
  for (const name of Object.getOwnPropertyNames(own).filter((one) => /^draw(Arr|El)/.test(one))) {
    const draw = own[name];
    own[name] = function (...given) { isDrawn = true; return draw.apply(this, given); };
  }
  for (const name of ["bufferData", "bufferSubData"]) {
    const fill = own[name];
    own[name] = function (...given) {
      const sizes = given.map((one) => one?.byteLength ?? 0);
      if (Math.max(...sizes) >= 600000) window.clouds_++;
      return fill.apply(this, given);
    };
  }
}
const tick = () => { window.frames_ += isDrawn; isDrawn = false; requestAnimationFrame(tick); };
requestAnimationFrame(tick);
"""
Cloud = tuple[np.ndarray, np.ndarray]
Show = Callable[[Cloud], None]
Move = Callable[[int, tuple[float, float, float]], None]


def serve_ours(port: int) -> tuple[Show, Move, Callable]:
    server = PageServer("127.0.0.1", port, "3D", access_rules("127.0.0.1", token=False))
    tree = server.space.tree
    cloud = tree.add("/cloud", Points(size=0.05))
    boxes = [tree.add(f"/box{number}", SpaceNode()) for number in range(BOXES)]
    for number in range(BOXES):
        row = solid_row((0.3, 0.3, 0.3), (200, 80, 40))
        tree.add(f"/box{number}/shape", Solids(shape="cube", rows=row))

    def show(points: Cloud) -> None:
        with tree.atomic():
            cloud.points, cloud.colors = points

    return show, lambda n, place: setattr(boxes[n], "position", place), tree.atomic


def serve_viser(port: int) -> tuple[Show, Move, Callable]:
    import viser  # only where it is measured

    server = viser.ViserServer("127.0.0.1", port, verbose=False)
    xyz, rgb = cloud_at(0)
    cloud = server.scene.add_point_cloud("/cloud", xyz, rgb, point_size=0.05, precision="float32")
    boxes = [server.scene.add_frame(f"/box{n}", show_axes=False) for n in range(BOXES)]
    for number in range(BOXES):
        server.scene.add_box(f"/box{number}/shape", (200, 80, 40), (0.3, 0.3, 0.3))

    def show(points: Cloud) -> None:
        with server.atomic():
            cloud.points, cloud.colors = points

    return show, lambda n, place: setattr(boxes[n], "position", place), server.atomic


def cloud_at(step: int) -> Cloud:
    """A ring of points that turns."""
    rng = np.random.default_rng(1)
    angle, radius = rng.uniform(0, 2 * np.pi, POINTS) + 0.02 * step, rng.uniform(2, 9, POINTS)
    height = rng.uniform(0, 2, POINTS)
    xyz = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    rgb = np.stack([height * 127, 255 - height * 127, np.full(POINTS, 90)], axis=1)
    return xyz.astype(np.float32), rgb.astype(np.uint8)


def serve(kind: str, port: int) -> None:
    """Change the scene until the process is ended."""
    clouds = [cloud_at(step) for step in range(10)]  # computed before
    show, move, atomic = {"ours": serve_ours, "viser": serve_viser}[kind](port)
    print("ready", flush=True)
    start_s = cloud_s = move_s = time.monotonic()
    step = 0
    while True:
        now_s = time.monotonic()
        if now_s >= cloud_s:
            cloud_s, step = cloud_s + CLOUD_S, step + 1
            show(clouds[step % len(clouds)])
        if now_s >= move_s:
            move_s += MOVE_S
            with atomic():
                for number in range(BOXES):
                    angle = number * 0.3 + (now_s - start_s)
                    move(number, (8 * np.cos(angle), 8 * np.sin(angle), number / 60))
        time.sleep(max(min(cloud_s, move_s) - time.monotonic(), 0))


def cpu_s(process: subprocess.Popen[str]) -> float:
    with open(f"/proc/{process.pid}/stat") as stat:
        fields = stat.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def sent_bytes(port: int) -> int:
    """Bytes that connections of a port have delivered."""
    text = subprocess.check_output(["ss", "-tinH", f"sport = :{port}"], text=True)
    return sum(
        int(word.partition(":")[2]) for word in text.split() if word.startswith("bytes_acked")
    )


def measure(kind: str, browser: Browser, port: int, seconds: float) -> dict[str, float]:
    command = [sys.executable, __file__, "--serve", kind, "--port", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        while "ready" not in server.stdout.readline():
            pass
        time.sleep(2)
        before, start_s = cpu_s(server), time.monotonic()
        time.sleep(4)
        idle = (cpu_s(server) - before) / (time.monotonic() - start_s)
        tab = browser.new_page(viewport={"width": 1280, "height": 720})
        said: list[str] = []
        tab.on("console", lambda message: said.append(message.text))
        tab.add_init_script(COUNT)
        path = "/?layout={~panel~:~space~}" if kind == "ours" else "/"
        tab.goto(f"http://127.0.0.1:{port}{path}")
        tab.wait_for_function("window.clouds_ > 5", timeout=60_000)
        tab.wait_for_timeout(1000 * WARM_S)
        start_s, cpu, data = time.monotonic(), cpu_s(server), sent_bytes(port)
        frames, clouds, noise = tab.evaluate("frames_"), tab.evaluate("clouds_"), len(said)
        tab.wait_for_timeout(1000 * seconds)
        passed_s = time.monotonic() - start_s
        found = {
            "frames": (tab.evaluate("frames_") - frames) / passed_s,
            "clouds": (tab.evaluate("clouds_") - clouds) / passed_s,
            "cpu": 100 * ((cpu_s(server) - cpu) / passed_s - idle),
            "MB": (sent_bytes(port) - data) / passed_s / 1e6,
            "noise": (len(said) - noise) / passed_s,
        }
        tab.close()
        return found
    finally:
        server.kill()
        server.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=12)
    parser.add_argument("--kinds", nargs="+", default=["ours", "viser"])
    parser.add_argument("--serve")
    parser.add_argument("--port", type=int, default=PORT)
    args = parser.parse_args()
    if args.serve:
        serve(args.serve, args.port)
        return
    rounds: list[dict[str, dict[str, float]]] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for number in range(args.rounds):
            ports = {kind: args.port + 10 * number + i for i, kind in enumerate(args.kinds)}
            rounds.append({k: measure(k, browser, port, args.seconds) for k, port in ports.items()})
        browser.close()
    print("| | frames/s | clouds/s | server CPU, % | MB/s | console lines/s |")
    print("|---|---|---|---|---|---|")
    for kind in args.kinds:
        medians = [
            statistics.median(one[kind][name] for one in rounds)
            for name in ("frames", "clouds", "cpu", "MB", "noise")
        ]
        print(f"| {kind} | " + " | ".join(f"{value:.1f}" for value in medians) + " |")


if __name__ == "__main__":
    main()
