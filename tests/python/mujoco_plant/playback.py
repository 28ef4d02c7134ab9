"""The rules of docs/wire.md a second time, without the client's code, to hold the client to: a command that answers the
sample stamped t acts at t plus the command delay, and its plan is played by elapsed time."""


class Playback:
    """Every sample is answered before its command is due, since the plant waits for it."""

    def __init__(self, delay_ns, axes, hold):
        self.delay_ns = delay_ns
        self.axes = axes
        # The code of a command that says to stand still.
        self.hold = hold
        self.waiting = []
        self.in_force = None

    def receive(self, command):
        """A command, in the order of the samples that they answer."""
        self.waiting.append((command.state_stamp_ns + self.delay_ns, command))

    def apply(self, now_ns):
        """Puts in force what is due."""
        while self.waiting and self.waiting[0][0] <= now_ns:
            self.in_force = self.waiting.pop(0)

    def applied_sequence(self):
        """Sequence of the command in force; 0 before the first."""
        return 0 if self.in_force is None else self.in_force[1].sequence

    def step(self, now_ns):
        """Which step of its plan the command in force is in: 0 before the first command, None when it says to stand still."""
        if self.in_force is None:
            return 0
        acts_ns, command = self.in_force
        if command.motion == self.hold or now_ns >= command.valid_until_ns:
            return None
        ended = sum(end <= now_ns - acts_ns for end in command.plan_end_ns[: command.plan_length])
        return min(ended, max(0, command.plan_length - 1))

    def offset(self, step):
        """The velocity offset in m/s and rad/s in a step of that plan; None when the joints are to hold."""
        if step is None:
            return None
        if self.in_force is None:
            return (0.0,) * self.axes
        command = self.in_force[1]
        return tuple((command.planned_offset[step] if step else command.velocity_offset)[: self.axes])
