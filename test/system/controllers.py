# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The controller manager of an example, played by the twin: a cycle every 10 ms, in a process.

Does what it reads on standard input, one JSON object per line, and answers each by one line.

usage: controllers.py ROBOT NAMESPACE
"""

from contextlib import suppress
import json
import math
from pathlib import Path
import queue
import sys
import threading
import time

from ending import until_told_to_end
import rclpy
from rclpy.executors import SingleThreadedExecutor
from ros2_control_twin import Constraints, HardwareTwin, run, System, TrajectoryTwin
import yaml

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
PERIOD = 0.01


class Manager:
    """What there is to be asked for; times are those of the system clock, as frames have them."""

    def __init__(self, node, robot):
        self.hardware = HardwareTwin(node, System(FOLDER / f'{robot}.urdf'))
        text = (FOLDER / f'{robot}_controllers.yaml').read_text(encoding='utf-8')
        own = yaml.safe_load(text)[f'{robot}_controller']['ros__parameters']
        self.controller = None
        if 'joints' in own:
            self.controller = TrajectoryTwin(self.hardware, Constraints.of(own), PERIOD)

    def cycle(self):
        run(self.hardware, lambda: self.controller and self.controller.update(time.time()))

    def activate(self):
        """Activate the controller, once all states are known."""
        known = all(map(math.isfinite, self.hardware.state.values()))
        if known:
            self.controller.activate()
        return known

    def go(self, goal, duration):
        """Begin a trajectory; return when, and from where."""
        began = time.time()
        self.controller.go(goal, duration, began)
        return [began, self.controller.desired(began)]

    def result(self):
        return self.controller.result

    def command(self, values, kind):
        """Put commands into their interfaces, as a controller would."""
        for joint, value in values.items():
            self.hardware.command[joint, kind] = value

    def look(self):
        """Return the last message and the states, and why the component is unconfigured."""
        message = self.hardware.latest
        return {'names': list(message.name), 'thrown': self.hardware.thrown,
                'velocity': [None if math.isnan(value) else value for value in message.velocity],
                'states': {f'{joint}/{kind}': value for (joint, kind), value
                           in self.hardware.state.items() if math.isfinite(value)}}


def read_lines(lines):
    for line in sys.stdin:
        lines.put(line)
    lines.put(None)


def serve(manager, executor):
    lines = queue.SimpleQueue()
    threading.Thread(target=read_lines, args=(lines,), daemon=True).start()
    due = time.monotonic()
    while True:
        with suppress(queue.Empty):
            line = lines.get_nowait()
            if line is None:
                return
            arguments = json.loads(line)
            answer = getattr(manager, arguments.pop('action'))(**arguments)
            print(json.dumps(answer), flush=True)
        manager.cycle()
        due = max(due + PERIOD, time.monotonic())
        while (left := due - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)


def main():
    robot, namespace = sys.argv[1:]
    rclpy.init(args=['--ros-args', *(
        part for topic in ('joint_states', 'joint_commands')
        for part in ('-r', f'/robot_{topic}:=/{namespace}/robot_{topic}'))])
    with until_told_to_end():
        node = rclpy.create_node('controller_manager', namespace=namespace)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        serve(Manager(node, robot), executor)


if __name__ == '__main__':
    main()
