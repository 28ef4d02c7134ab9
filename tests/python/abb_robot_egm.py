"""ABBRobotEGM, which nobody here wrote, on both sides: as the sensor of the emulated robot, and its messages as a robot's.

abb_robot_egm.py sensor PLANT_SIM ARGUMENT...            1000 cycles of joint speeds to plant-sim --egm, which it starts
abb_robot_egm.py torques PLANT_SIM ARGUMENT...           50 cycles of standstill: what its motors' torques are read as
abb_robot_egm.py robot PORT                              is a robot at rest for 200 messages; the edge answers at PORT
abb_robot_egm.py read EgmRobot|EgmSensor HEX             what it reads in a message, and the message that it makes of that
Prints one JSON object."""

import json
import socket
import subprocess
import sys
import time

import numpy
from ABBRobotEGM import EGM
from ABBRobotEGM._egm_protobuf import egm_pb2
from google.protobuf.json_format import MessageToDict, ParseDict

CYCLES = 1000
# Degrees per second.
SPEED = numpy.array([1.0, -2.0, 3.0, 0.5, -0.5, 4.0])


def session(program, cycles, speed):
    """What the emulated robot says while it is sent these speeds."""
    # A free port: the package takes no 0.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    with EGM(port) as egm:
        robot = subprocess.Popen(program + ["--egm", f"127.0.0.1:{port}"])
        try:
            states = []
            while len(states) < cycles:
                there, state = egm.receive_from_robot(5.0)
                assert there, "the emulated robot is silent"
                assert egm.send_to_robot(None, speed_ref=speed), "nothing was sent"
                states.append(state)
        finally:
            robot.terminate()
            robot.wait()
    return states


def torques(program):
    return {"torques": list(session(program, 50, numpy.zeros(6))[-1].torque_ref)}


def sensor(program):
    states = session(program, CYCLES, SPEED)
    first, last = states[CYCLES // 2], states[-1]
    seconds = (last.clock.seconds - first.clock.seconds) + 1e-6 * (last.clock.microseconds - first.clock.microseconds)
    return {
        "cycles": len(states),
        "numbers": last.header.seqno - states[0].header.seqno,
        "speed": list((last.joint_angles - first.joint_angles) / seconds),
        "expected": list(SPEED),
        "motors_on": last.motors_on,
        "rapid_running": last.rapid_running,
        "planned": len(last.joint_angles_planned),
        "force": len(last.measured_force),
    }


def robot(port):
    joints = [17.0, 68.0, -103.0, 126.0, 90.0, 17.0]
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.settimeout(1.0)
    answers = []
    for cycle in range(1, 201):
        # Python keeps no cycle: the robot's clock says when it really is.
        microseconds = time.monotonic_ns() // 1000
        message = egm_pb2.EgmRobot()
        message.header.seqno = cycle
        message.header.tm = microseconds // 1000 % 2**32
        message.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
        message.feedBack.joints.joints.extend(joints)
        message.feedBack.externalJoints.joints.extend([5.0, 6.0])
        message.feedBack.time.sec = microseconds // 1000000
        message.feedBack.time.usec = microseconds % 1000000
        message.planned.joints.joints.extend(joints)
        message.motorState.state = egm_pb2.EgmMotorState.MOTORS_ON
        message.mciState.state = egm_pb2.EgmMCIState.MCI_RUNNING
        message.rapidExecState.state = egm_pb2.EgmRapidCtrlExecState.RAPID_RUNNING
        message.measuredForce.fcActive = True
        message.measuredForce.force.extend([0.0] * 6)
        link.sendto(message.SerializeToString(), ("127.0.0.1", port))
        answer = egm_pb2.EgmSensor()
        answer.ParseFromString(link.recvfrom(65536)[0])
        answers.append(answer)
        time.sleep(0.004)
    last = answers[-1]
    return {
        "answers": len(answers),
        "type": egm_pb2.EgmHeader.MessageType.Name(last.header.mtype),
        "joints": list(last.speedRef.joints.joints),
        "external": list(last.speedRef.externalJoints.joints),
        "has_position": last.HasField("planned"),
    }


def read(kind, message):
    told = getattr(egm_pb2, kind)()
    told.ParseFromString(bytes.fromhex(message))
    values = MessageToDict(told)
    return {"read": values, "written": ParseDict(values, getattr(egm_pb2, kind)()).SerializeToString().hex()}


said = {
    "sensor": sensor,
    "torques": torques,
    "robot": lambda arguments: robot(int(arguments[0])),
    "read": lambda arguments: read(*arguments),
}
print(json.dumps(said[sys.argv[1]](sys.argv[2:])))
