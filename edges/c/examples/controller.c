/* A motion controller in C: controller ROOT_PATH PREFIX INSTANCE SCENARIO. The robot is the one of plant.h; yours is
 * where this program calls it. It ends when its motion is over, or by SIGTERM. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "admittance_client.h"
#include "plant.h"

/* What this controller accepts of a daemon at most. Less than the daemon's own [limits] would refuse its stops. */
#define MOST_OFFSET_M_S 10.0
#define MOST_JOINT_OFFSET_RAD_S 6.0
/* Before the end of a cycle it stops looking for an answer. */
#define SLACK_NS 400000u

static volatile sig_atomic_t is_asked_to_end;

static void ask_to_end(int signal) {
    (void)signal;
    is_asked_to_end = 1;
}

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static void wait_until(uint64_t instant_ns) {
    struct timespec until;
    until.tv_sec = (time_t)(instant_ns / 1000000000u);
    until.tv_nsec = (long)(instant_ns % 1000000000u);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) != 0 && !is_asked_to_end) {
    }
}

/* Takes the answer to the sample that was just published, or gives up in time for what the cycle has to do besides.
 * The time from the sample's stamp to the answer; 0 without one. */
static uint64_t take_answer(admittance_client *client, uint64_t sequence, uint64_t stamp_ns, uint64_t give_up_ns) {
    admittanced_command_sample answer;
    for (;;) {
        uint64_t now = now_ns();
        admittance_status status = admittance_client_receive(client, now);
        if (status < 0)
            fprintf(stderr, "refused: %s\n", admittance_client_text(client));
        else if (status != ADMITTANCE_STATUS_NO_ANSWER && admittance_client_newest(client, &answer) >= 0 &&
                 answer.state_sequence == sequence)
            return now - stamp_ns;
        if (now >= give_up_ns)
            return 0;
        wait_until(now + 20000u); /* looking without a pause would take a processor */
    }
}

/* One cycle: what is measured is published, the answer taken, and the joints follow. When the next one begins. */
static uint64_t run_cycle(admittance_client *client, plant *robot, uint64_t stamp_ns) {
    admittanced_state_sample sample;
    admittance_instruction instruction;
    admittance_counts counts;
    plant_cycle cycle;
    uint64_t end_ns = plant_cycle_end_ns(robot), sequence, reached_ns;

    memset(&cycle, 0, sizeof cycle);
    wait_until(stamp_ns);
    cycle.lateness_ns = now_ns() - stamp_ns;
    admittance_client_begin(client, stamp_ns, &sample);
    sequence = sample.sequence;
    if (plant_measure(robot, &sample)) { /* here yours sets positions, velocities, references, wrench, drives_enabled */
        admittance_status status = admittance_client_publish(client, &sample);
        if (status < 0)
            fprintf(stderr, "not published: %s\n", admittance_client_text(client));
    }
    if (plant_shows_commands(robot))
        cycle.answer_time_ns = take_answer(client, sequence, stamp_ns, end_ns - SLACK_NS);
    admittance_client_counts(client, end_ns, &counts);
    cycle.missed = counts.is_missing;
    cycle.missed_commands = counts.missed + counts.is_missing;
    /* What the joints follow changes within a cycle: when the answer is due, and at the steps of its plan. */
    admittance_client_apply(client, stamp_ns, &instruction);
    cycle.motion = instruction.motion;
    memcpy(cycle.velocity_offset, instruction.velocity_offset, sizeof cycle.velocity_offset);
    plant_truth(robot, &cycle);
    for (reached_ns = stamp_ns; reached_ns < end_ns;) {
        admittance_client_apply(client, reached_ns, &instruction);
        reached_ns = plant_follow(robot, instruction.motion, instruction.velocity_offset, instruction.until_ns);
    }
    plant_arrive(robot, (int)counts.has_received);
    admittance_client_make_ready(client);
    return end_ns;
}

int main(int argc, char **argv) {
    admittance_options options;
    admittance_client *client;
    plant_timing timing;
    plant *robot;
    char message[512];
    uint64_t stamp_ns = now_ns() + 50000000u;
    int i;

    if (argc != 5) {
        fprintf(stderr, "usage: %s ROOT_PATH PREFIX INSTANCE SCENARIO\n", argv[0]);
        return 64;
    }
    signal(SIGTERM, ask_to_end);
    signal(SIGINT, ask_to_end);
    robot = plant_open(argv[4], stamp_ns, &timing);
    if (robot == NULL)
        return 78;
    memset(&options, 0, sizeof options);
    options.root_path = argv[1];
    options.prefix = argv[2];
    options.instance = argv[3];
    options.name = "controller.c";
    options.sampling_time_ns = timing.sampling_time_ns;
    options.command_delay_ns = timing.command_delay_ns;
    for (i = 0; i < ADMITTANCED_TASK_AXES; i++)
        options.velocity_offset_limit[i] = MOST_OFFSET_M_S;
    for (i = 0; i < ADMITTANCED_MAX_JOINTS; i++)
        options.joint_velocity_offset_limit[i] = MOST_JOINT_OFFSET_RAD_S;
    options.joint_count = timing.joint_count;
    options.abi_version = ADMITTANCE_CLIENT_ABI_VERSION;
    if (admittance_client_open(&options, &client, message, sizeof message) < 0) {
        fprintf(stderr, "%s\n", message);
        plant_close(robot);
        return 69;
    }
    while (!is_asked_to_end && !plant_is_finished(robot))
        stamp_ns = run_cycle(client, robot, stamp_ns);
    admittance_client_close(client);
    plant_close(robot);
    return 0;
}
