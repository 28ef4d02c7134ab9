/* A motion controller's side of admittanced (docs/client.md). Generated: do not edit. Units are SI and radians,
 * instants nanoseconds of CLOCK_MONOTONIC. One thread at a time uses a handle. */

#ifndef ADMITTANCE_CLIENT_H
#define ADMITTANCE_CLIENT_H

#include <stddef.h>
#include <stdint.h>
#include "admittanced.h"
/* Version of the interface that this header describes. */
#define ADMITTANCE_CLIENT_ABI_VERSION 1u

/* What a call says. Below 0: it failed. */
typedef int32_t admittance_status;
#define ADMITTANCE_STATUS_OK (0) /* done */
#define ADMITTANCE_STATUS_NO_ANSWER (1) /* there is no answer that was not taken yet */
#define ADMITTANCE_STATUS_LATE (2) /* the answer came too late to act at its instant: it acts from the next sample on */
#define ADMITTANCE_STATUS_INVALID_ARGUMENT (-1) /* an argument is NULL, or not accepted */
#define ADMITTANCE_STATUS_UNAVAILABLE (-2) /* shared memory, a service or a port cannot be had */
#define ADMITTANCE_STATUS_PERMISSION (-3) /* shared memory belongs to another user, or is not writable */
#define ADMITTANCE_STATUS_SCHEMA (-4) /* the other side speaks another version of the wire contract */
#define ADMITTANCE_STATUS_NO_ROOM (-5) /* there was no room for a sample: it was not published */
#define ADMITTANCE_STATUS_NOT_FINITE (-10) /* refused: a number of the answer is not finite */
#define ADMITTANCE_STATUS_JOINT_COUNT (-11) /* refused: the answer is for another number of joints */
#define ADMITTANCE_STATUS_MOTION (-12) /* refused: the answer has a motion code that is not declared */
#define ADMITTANCE_STATUS_PLAN (-13) /* refused: the plan of the answer is too long, or its end times do not increase */
#define ADMITTANCE_STATUS_BEYOND_LIMIT (-14) /* refused: the answer is beyond the limits of this controller */
#define ADMITTANCE_STATUS_OLDER (-15) /* refused: a newer sample was answered before */
#define ADMITTANCE_STATUS_UNKNOWN_SAMPLE (-16) /* refused: the answer is to a sample that this boot has not published */
#define ADMITTANCE_STATUS_PANICKED (-99) /* the library failed: close the handle, and hold */


/*
 A motion controller that is connected, or waits for a daemon.
 */
typedef struct admittance_client admittance_client;

/*
 What a motion controller is opened with. Everything has to be set; nothing has a default.
 */
typedef struct admittance_options {
  /*
   ADMITTANCE_CLIENT_ABI_VERSION, as it was when the program was built.
   */
  uint32_t abi_version;
  /*
   Joints, 1 to 8.
   */
  uint32_t joint_count;
  /*
   `ipc.root_path` of the daemon: an absolute path, such as "/run/admittanced".
   */
  const char *root_path;
  /*
   `ipc.prefix` of the daemon.
   */
  const char *prefix;
  /*
   `ipc.instance` of the daemon.
   */
  const char *instance;
  /*
   Name of this controller for tools.
   */
  const char *name;
  /*
   Time from sample to sample in ns.
   */
  uint64_t sampling_time_ns;
  /*
   When the answer to a sample acts, in ns after its stamp: `control.command_delay_s` of the daemon.
   */
  uint64_t command_delay_ns;
  /*
   The controller's own limits: the largest magnitude of a velocity offset that it accepts on each axis, m/s and
   rad/s, x y z rx ry rz. Above 0; INFINITY for none. Less than the daemon's `[limits]` would refuse its stops.
   */
  double velocity_offset_limit[ADMITTANCED_TASK_AXES];
  /*
   The same for each joint of its joint-space image, rad/s (m/s of one that slides). Above 0; INFINITY for none.
   */
  double joint_velocity_offset_limit[ADMITTANCED_MAX_JOINTS];
} admittance_options;

/*
 What the joints are to do.
 */
typedef struct admittance_instruction {
  /*
   Velocity offset to add to the twist reference, m/s and rad/s: x y z rx ry rz, base frame, at the TCP. Zero when
   they hold.
   */
  double velocity_offset[ADMITTANCED_TASK_AXES];
  /*
   Until when this holds, in ns of CLOCK_MONOTONIC, unless an answer that is received meanwhile says otherwise;
   UINT64_MAX for ever.
   */
  uint64_t until_ns;
  /*
   ADMITTANCED_MOTION_OFFSET: follow the twist reference plus the offset. ADMITTANCED_MOTION_HOLD: zero joint
   velocity, whatever the twist reference is.
   */
  uint32_t motion;
  /*
   Not used: 0.
   */
  uint32_t reserved;
} admittance_instruction;

/*
 What became of the answers so far.
 */
typedef struct admittance_counts {
  /*
   Answers that came too late to act, or never, since the first accepted one.
   */
  uint64_t missed;
  /*
   Answers that were refused.
   */
  uint64_t rejected;
  /*
   Number of the command in force; 0 = none yet.
   */
  uint64_t applied_sequence;
  /*
   1 once an answer was accepted.
   */
  uint32_t has_received;
  /*
   1 when an answer that is due before the instant asked for is missing.
   */
  uint32_t is_missing;
} admittance_counts;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 The version of this library's interface, to compare with ADMITTANCE_CLIENT_ABI_VERSION.
 */
uint32_t admittance_client_abi_version(void);

/*
 What a status says in general, as a text that lasts as long as the program; for a number that is no status as well.
 */
const char *admittance_status_text(int32_t status);

/*
 Opens the ports of a motion controller. It allocates and takes milliseconds: call it before the cycle starts.

 On success *client is a handle for admittance_client_close. Otherwise *client is NULL, and `message` (NULL for none)
 gets a text of at most `message_size` bytes with its end that names the option, its value and what is accepted.

 # Safety
 `options` points to options whose texts end in zero bytes; `client` to room for a pointer; `message` to
 `message_size` bytes, or it is NULL.
 */
admittance_status admittance_client_open(const struct admittance_options *options,
                                         struct admittance_client **client,
                                         char *message,
                                         size_t message_size);

/*
 Closes the ports. NULL is accepted.

 # Safety
 `client` is a handle that is not used again, or NULL.
 */
void admittance_client_close(struct admittance_client *client);

/*
 A cycle begins whose state was measured at `stamp_ns` of CLOCK_MONOTONIC. Fills in who the sample is from (sequence,
 stamp, boot, joints, the command in force; plays_plan = 1) and sets the rest to 0: positions, velocities, references,
 wrench, wrench_valid, joint_torque, torque_valid, follows_joint_velocity, joint_velocity_reference and drives_enabled are
 the caller's to set.

 # Safety
 `client` is a handle that no other thread uses; `sample` points to room for a sample.
 */
admittance_status admittance_client_begin(struct admittance_client *client,
                                          uint64_t stamp_ns,
                                          admittanced_state_sample *sample);

/*
 Publishes the sample and wakes the daemon: the one system call of a cycle. It is no failure when no daemon runs.

 # Safety
 `client` is a handle that no other thread uses; `sample` points to a sample.
 */
admittance_status admittance_client_publish(struct admittance_client *client, const admittanced_state_sample *sample);

/*
 Takes the newest answer, if one has come that was not taken yet; it does not wait. `now_ns` is the present instant of
 CLOCK_MONOTONIC: it decides whether the answer is there before it has to act.

 ADMITTANCE_STATUS_OK: accepted, and it acts when it is due. ADMITTANCE_STATUS_LATE: accepted, and it acts from the
 next sample on. ADMITTANCE_STATUS_NO_ANSWER: there is none. Below 0: refused; admittance_client_text says why.

 # Safety
 `client` is a handle that no other thread uses.
 */
admittance_status admittance_client_receive(struct admittance_client *client, uint64_t now_ns);

/*
 Puts the answers in force that are due by `now_ns`, and says what the joints are to do: the answer to the sample
 stamped t acts at t + command_delay_ns, exactly. Without a newer one its plan is played by elapsed time, and when it
 is no longer valid the joints hold. Before the first answer ever the offset is zero.

 With a status below 0 the instruction is to hold.

 # Safety
 `client` is a handle that no other thread uses; `instruction` points to room for one.
 */
admittance_status admittance_client_apply(struct admittance_client *client,
                                          uint64_t now_ns,
                                          struct admittance_instruction *instruction);

/*
 What the joints of a controller add to joint_velocity_reference at `now_ns`, rad/s or m/s of a prismatic joint, after
 admittance_client_apply at that instant: of one that says follows_joint_velocity = 1 in its samples, and leaves to the
 daemon how a twist moves its joints. Zeros while the instruction is to hold: then the joint velocity is zero, whatever
 the reference is.

 # Safety
 `client` is a handle that no other thread uses; `joint_velocity_offset` points to room for ADMITTANCED_MAX_JOINTS
 numbers.
 */
admittance_status admittance_client_joint_velocity_offset(struct admittance_client *client,
                                                          uint64_t now_ns,
                                                          double *joint_velocity_offset);

/*
 Makes room for the next sample, so that admittance_client_publish finds it: once per cycle, when the answer has been
 taken. It is done on a cycle's slack, and without it publish does the same itself, a little later.

 # Safety
 `client` is a handle that no other thread uses.
 */
admittance_status admittance_client_make_ready(struct admittance_client *client);

/*
 Copies the newest accepted answer, with mode, verdict, stop reason and plan. ADMITTANCE_STATUS_NO_ANSWER, and nothing
 copied, before the first.

 # Safety
 `client` is a handle that no other thread uses; `command` points to room for a command.
 */
admittance_status admittance_client_newest(struct admittance_client *client, admittanced_command_sample *command);

/*
 Counts of the answers so far; `until_ns` is the instant up to which is_missing looks.

 # Safety
 `client` is a handle that no other thread uses; `counts` points to room for them.
 */
admittance_status admittance_client_counts(struct admittance_client *client,
                                           uint64_t until_ns,
                                           struct admittance_counts *counts);

/*
 Why the last call with a status below 0 failed, with the values that were wrong; empty before. It lasts until the
 next call.

 # Safety
 `client` is a handle that no other thread uses, or NULL.
 */
const char *admittance_client_text(const struct admittance_client *client);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ADMITTANCE_CLIENT_H */
