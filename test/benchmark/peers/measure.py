"""What every peer's process reports, as one line of JSON on its standard output."""

import json
import resource
import time


class Stopwatch:
    """CPU and wall seconds of this process, all threads."""

    def __init__(self):
        self.cpu = time.process_time()
        self.wall = time.perf_counter()

    def read(self):
        return {"cpu_s": time.process_time() - self.cpu, "wall_s": time.perf_counter() - self.wall}


def peak_memory_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def report(**values):
    print(json.dumps({**values, "peak_memory_mb": peak_memory_mb()}))
