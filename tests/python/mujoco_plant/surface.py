"""What the TCP presses on: a plane that pushes back like a spring, drags, and never pulls."""

import math


class Surface:
    """f_n = max(0, k d + c d') while d > 0; friction mu f_n along the sliding direction."""

    def __init__(self, section):
        length = math.sqrt(sum(n * n for n in section["normal"]))
        self.normal = [n / length for n in section["normal"]]
        self.point = section["point_m"]
        self.stiffness = section["stiffness_n_m"]
        self.damping = section.get("damping_n_s_m", 0.0)
        self.friction = section.get("friction", 0.0)
        self.slip_velocity = section.get("slip_velocity_m_s", 0.001)

    def contact(self, position, velocity):
        """The force along the inward normal in N, and the force in N that the robot exerts on the surface, of a TCP at a
        position in m with a velocity in m/s. Plain numbers: numpy takes longer over three of them."""
        normal = self.normal
        depth = sum(n * (point - at) for n, point, at in zip(normal, self.point, position))
        if depth <= 0.0:
            return 0.0, (0.0, 0.0, 0.0)
        outward = sum(n * v for n, v in zip(normal, velocity))
        pressing = max(0.0, self.stiffness * depth - self.damping * outward)
        sliding = [v - n * outward for n, v in zip(normal, velocity)]
        speed = math.sqrt(sum(v * v for v in sliding))
        drag = self.friction * pressing / math.hypot(speed, self.slip_velocity)
        return pressing, tuple(drag * v - pressing * n for n, v in zip(normal, sliding))
